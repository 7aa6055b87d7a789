//! Register offsets and bits (RM0440, 44.4).

pub(super) const CREL: u32 = 0x000;
pub(super) const ENDN: u32 = 0x004;
pub(super) const DBTP: u32 = 0x00C;
pub(super) const TEST: u32 = 0x010;
pub(super) const RWD: u32 = 0x014;
pub(super) const CCCR: u32 = 0x018;
pub(super) const NBTP: u32 = 0x01C;
pub(super) const TSCC: u32 = 0x020;
pub(super) const TSCV: u32 = 0x024;
pub(super) const TOCC: u32 = 0x028;
pub(super) const TOCV: u32 = 0x02C;
pub(super) const ECR: u32 = 0x040;
pub(super) const PSR: u32 = 0x044;
pub(super) const TDCR: u32 = 0x048;
pub(super) const IR: u32 = 0x050;
pub(super) const IE: u32 = 0x054;
pub(super) const ILS: u32 = 0x058;
pub(super) const ILE: u32 = 0x05C;
pub(super) const RXGFC: u32 = 0x080;
pub(super) const XIDAM: u32 = 0x084;
pub(super) const HPMS: u32 = 0x088;
pub(super) const RXF0S: u32 = 0x090;
pub(super) const RXF0A: u32 = 0x094;
pub(super) const RXF1S: u32 = 0x098;
pub(super) const RXF1A: u32 = 0x09C;
pub(super) const TXBC: u32 = 0x0C0;
pub(super) const TXFQS: u32 = 0x0C4;
pub(super) const TXBRP: u32 = 0x0C8;
pub(super) const TXBAR: u32 = 0x0CC;
pub(super) const TXBCR: u32 = 0x0D0;
pub(super) const TXBTO: u32 = 0x0D4;
pub(super) const TXBCF: u32 = 0x0D8;
pub(super) const TXBTIE: u32 = 0x0DC;
pub(super) const TXBCIE: u32 = 0x0E0;
pub(super) const TXEFS: u32 = 0x0E4;
pub(super) const TXEFA: u32 = 0x0E8;
/// Of FDCAN1 only; divides the kernel clock of all three.
pub(super) const CKDIV: u32 = 0x100;

/// Core release 3.2.1, step 4 (18 December 2014).
pub(super) const CREL_VALUE: u32 = 0x3214_1218;
pub(super) const ENDN_VALUE: u32 = 0x8765_4321;
pub(super) const DBTP_RESET: u32 = 0x0000_0A33;
pub(super) const NBTP_RESET: u32 = 0x0600_0A03;
pub(super) const TOCC_RESET: u32 = 0xFFFF_0000;
pub(super) const TOCV_RESET: u32 = 0x0000_FFFF;
pub(super) const XIDAM_RESET: u32 = 0x1FFF_FFFF;
/// DLEC, LEC = no change.
pub(super) const PSR_DLEC_NO_CHANGE: u32 = 0b111 << 8;
pub(super) const LEC_NO_CHANGE: u32 = 0b111;

pub(super) mod cccr {
    pub(crate) const INIT: u32 = 1 << 0;
    pub(crate) const CCE: u32 = 1 << 1;
    pub(crate) const ASM: u32 = 1 << 2;
    pub(crate) const CSA: u32 = 1 << 3;
    pub(crate) const CSR: u32 = 1 << 4;
    pub(crate) const MON: u32 = 1 << 5;
    pub(crate) const DAR: u32 = 1 << 6;
    pub(crate) const TEST: u32 = 1 << 7;
    pub(crate) const FDOE: u32 = 1 << 8;
    pub(crate) const TXP: u32 = 1 << 14;
    /// All that can be written.
    pub(crate) const WRITABLE: u32 = 0xF3F7;
    /// Written only while INIT and CCE are set (ASM, MON and TEST may always
    /// be cleared).
    pub(crate) const PROTECTED: u32 = WRITABLE & !(INIT | CCE | CSR);
    /// May be cleared at any time.
    pub(crate) const CLEARABLE: u32 = ASM | MON | TEST;
}

pub(super) const TEST_LBCK: u32 = 1 << 4;
pub(super) const TEST_RX: u32 = 1 << 7;

pub(super) mod ir {
    pub(crate) const RF0N: u32 = 1 << 0;
    pub(crate) const RF0F: u32 = 1 << 1;
    pub(crate) const RF0L: u32 = 1 << 2;
    pub(crate) const HPM: u32 = 1 << 6;
    pub(crate) const TC: u32 = 1 << 7;
    pub(crate) const TCF: u32 = 1 << 8;
    pub(crate) const TFE: u32 = 1 << 9;
    pub(crate) const TEFN: u32 = 1 << 10;
    pub(crate) const TEFF: u32 = 1 << 11;
    pub(crate) const TEFL: u32 = 1 << 12;
    pub(crate) const TSW: u32 = 1 << 13;
    pub(crate) const ELO: u32 = 1 << 16;
    pub(crate) const EP: u32 = 1 << 17;
    pub(crate) const EW: u32 = 1 << 18;
    pub(crate) const BO: u32 = 1 << 19;
    pub(crate) const PEA: u32 = 1 << 21;
    pub(crate) const ALL: u32 = 0x00FF_FFFF;
    /// Distance from a flag of FIFO 0 to the same of FIFO 1.
    pub(crate) const FIFO_STEP: u32 = 3;

    /// Flag names for messages.
    pub(crate) const NAMES: [&str; 24] = [
        "RF0N", "RF0F", "RF0L", "RF1N", "RF1F", "RF1L", "HPM", "TC", "TCF", "TFE", "TEFN", "TEFF",
        "TEFL", "TSW", "MRAF", "TOO", "ELO", "EP", "EW", "BO", "WDI", "PEA", "PED", "ARA",
    ];
}

/// The interrupt flags that each ILS bit routes: RXFIFO0, RXFIFO1, SMSG,
/// TFERR, MISC, BERR, PERR.
pub(super) const ILS_GROUPS: [u32; 7] = [
    0b111,
    0b111 << 3,
    ir::HPM | ir::TC | ir::TCF,
    ir::TFE | ir::TEFN | ir::TEFF | ir::TEFL,
    ir::TSW | 1 << 14 | 1 << 15,
    ir::ELO | ir::EP,
    ir::EW | ir::BO | 0b1111 << 20,
];

pub(super) mod rxgfc {
    pub(crate) const RRFE: u32 = 1 << 0;
    pub(crate) const RRFS: u32 = 1 << 1;
    pub(crate) const ANFE_SHIFT: u32 = 2;
    pub(crate) const ANFS_SHIFT: u32 = 4;
    pub(crate) const F1OM: u32 = 1 << 8;
    pub(crate) const F0OM: u32 = 1 << 9;
    pub(crate) const LSS_SHIFT: u32 = 16;
    pub(crate) const LSS_MASK: u32 = 0x1F;
    pub(crate) const LSE_SHIFT: u32 = 24;
    pub(crate) const LSE_MASK: u32 = 0xF;
    pub(crate) const WRITABLE: u32 = 0x0F1F_033F;
}

pub(super) const TXBC_TFQM: u32 = 1 << 24;

/// Reads bits `shift..shift + width`.
pub(super) const fn field(value: u32, shift: u32, width: u32) -> u32 {
    value >> shift & ((1 << width) - 1)
}
