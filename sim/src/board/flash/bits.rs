//! Registers of FLASH (RM0440, 3.7).

pub(super) const ACR: u32 = 0x00;
pub(super) const KEYR: u32 = 0x08;
pub(super) const SR: u32 = 0x10;
pub(super) const CR: u32 = 0x14;
pub(super) const ECCR: u32 = 0x18;
pub(super) const OPTR: u32 = 0x20;
pub(super) const WRP1AR: u32 = 0x2C;
pub(super) const WRP1BR: u32 = 0x30;
pub(super) const WRP2AR: u32 = 0x4C;
pub(super) const WRP2BR: u32 = 0x50;
pub(super) const LAST: u32 = 0x74;

pub(super) const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

pub(super) const ACR_RESET: u32 = 0x0004_0600;
pub(super) const ACR_LATENCY: u32 = 0xF;
pub(super) const ACR_ICEN: u32 = 1 << 9;
pub(super) const ACR_DCEN: u32 = 1 << 10;
pub(super) const ACR_ICRST: u32 = 1 << 11;
pub(super) const ACR_DCRST: u32 = 1 << 12;

pub(super) const SR_EOP: u32 = 1 << 0;
pub(super) const SR_OPERR: u32 = 1 << 1;
pub(super) const SR_PROGERR: u32 = 1 << 3;
pub(super) const SR_WRPERR: u32 = 1 << 4;
pub(super) const SR_PGAERR: u32 = 1 << 5;
pub(super) const SR_SIZERR: u32 = 1 << 6;
pub(super) const SR_PGSERR: u32 = 1 << 7;
pub(super) const SR_BSY: u32 = 1 << 16;
/// Flags that stand in the way of the next operation.
pub(super) const SR_PROGRAM_ERRORS: u32 =
    SR_PROGERR | SR_WRPERR | SR_PGAERR | SR_SIZERR | SR_PGSERR;
/// Flags cleared by writing 1.
pub(super) const SR_CLEARABLE: u32 = SR_EOP | SR_OPERR | SR_PROGRAM_ERRORS;

pub(super) const CR_RESET: u32 = 0xC000_0000;
pub(super) const CR_PG: u32 = 1 << 0;
pub(super) const CR_PER: u32 = 1 << 1;
pub(super) const CR_MER1: u32 = 1 << 2;
pub(super) const CR_PNB_SHIFT: u32 = 3;
pub(super) const CR_PNB: u32 = 0x7F;
pub(super) const CR_BKER: u32 = 1 << 11;
pub(super) const CR_MER2: u32 = 1 << 15;
pub(super) const CR_STRT: u32 = 1 << 16;
pub(super) const CR_OPTSTRT: u32 = 1 << 17;
pub(super) const CR_FSTPG: u32 = 1 << 18;
pub(super) const CR_EOPIE: u32 = 1 << 24;
pub(super) const CR_ERRIE: u32 = 1 << 25;
pub(super) const CR_OBL_LAUNCH: u32 = 1 << 27;
pub(super) const CR_OPTLOCK: u32 = 1 << 30;
pub(super) const CR_LOCK: u32 = 1 << 31;
/// What is not modelled: mass erase, option bytes, fast programming.
pub(super) const CR_UNMODELLED: u32 = CR_MER1 | CR_MER2 | CR_OPTSTRT | CR_FSTPG | CR_OBL_LAUNCH;

pub(super) const ECCR_BANK: u32 = 1 << 21;
pub(super) const ECCR_ECCIE: u32 = 1 << 24;
pub(super) const ECCR_ECCD2: u32 = 1 << 29;
pub(super) const ECCR_ECCD: u32 = 1 << 31;
/// Flags cleared by writing 1: errors detected or corrected.
pub(super) const ECCR_FLAGS: u32 = 0xF << 28;
pub(super) const ECCR_DETECTED: u32 = ECCR_ECCD | ECCR_ECCD2;

/// Option bytes as delivered: dual bank.
pub(super) const OPTR_RESET: u32 = 0xFFEF_F8AA;
pub(super) const OPTR_DBANK: u32 = 1 << 22;

/// Start of a write-protected area, behind it at bit 16 its end; start above
/// end: nothing is protected.
pub(super) const WRP_END_SHIFT: u32 = 16;
pub(super) const WRP_PAGE: u32 = 0x7F;
pub(super) const WRP_NONE: u32 = WRP_PAGE;
