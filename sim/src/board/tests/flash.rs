//! A program erases and programs flash, in its own bank and in the other.

use super::super::{BankContents, DiagnosticKind, FlashOptions, irqs};
use super::*;

const FLASH: u32 = 0x4002_2000;
const ACR: u32 = FLASH;
const KEYR: u32 = FLASH + 0x08;
const SR: u32 = FLASH + 0x10;
const CR: u32 = FLASH + 0x14;
const ECCR: u32 = FLASH + 0x18;
const BANK2: u32 = 0x0804_0000;
const NMI: usize = 2;
const FLASH_EXCEPTION: usize = 16 + 4;
/// PER, STRT and the number of a page.
const ERASE_5_OF_BANK_1: u32 = 1 << 16 | 5 << 3 | 1 << 1;
const ERASE_0_OF_BANK_2: u32 = 1 << 16 | 1 << 11 | 1 << 1;
/// ICEN without DCEN.
const NO_DATA_CACHE: u32 = 0x0004_0200;
const HALVES: [u32; 2] = [0x89AB_CDEF, 0x0123_4567];

impl Program {
    fn unlocks(self) -> Self {
        self.store(ACR, NO_DATA_CACHE)
            .store(KEYR, 0x4567_0123)
            .store(KEYR, 0xCDEF_89AB)
    }

    /// Counts turns at `SRAM`, for ever.
    fn counts(self) -> Self {
        // LDR r1, [r0]; ADDS r1, 1; STR r1, [r0]; B back.
        self.store(SRAM, 0)
            .then(load(0, SRAM))
            .then([0x6801, 0x3101, 0x6001, 0xE7FB])
    }

    fn board_with(self, flash: FlashOptions) -> Board {
        let options = BoardOptions {
            flash,
            ..BoardOptions::default()
        };
        Board::from_image(self.image(), &options).expect("the board can be made")
    }
}

fn turns(board: &Board) -> u32 {
    board.word(SRAM).expect("SRAM")
}

#[test]
fn a_program_in_bank_1_runs_on_while_bank_2_is_erased() {
    let mut board = Program::default()
        .unlocks()
        .store(CR, ERASE_0_OF_BANK_2)
        .counts()
        .board_with(FlashOptions::default());
    board.run(Time::from_ms(10));
    // Eight cycles a turn at 16 MHz.
    assert!(turns(&board) > 19_900, "{}", turns(&board));
    assert_eq!(board.stats().flash.stalled_cycles, 0);
    board.run(Time::from_ms(30));
    let stats = board.stats();
    assert_eq!((stats.flash.erased, stats.flash.stalled_cycles), (1, 0));
    assert!(board.diagnostics().is_empty(), "{:?}", board.diagnostics());
}

#[test]
fn a_program_in_bank_1_waits_while_bank_1_is_erased_and_interrupts_with_it() {
    let mut handler = store(TIM2 + TIM_SR, 0);
    handler.extend(count(SRAM + 4));
    let program = |cr| {
        Program::default()
            .store(SRAM + 4, 0)
            .tim2_every(16_000)
            .unlocks()
            .store(CR, cr)
            .counts()
            .handler(TIM2_EXCEPTION, &handler)
    };
    let mut board = program(ERASE_5_OF_BANK_1).board_with(FlashOptions::default());
    board.run(Time::from_ms(20));
    assert_eq!(board.now(), Time::from_ms(20), "time is not jumped over");
    assert_eq!(board.word(SRAM + 4), Some(0), "no interrupt was taken");
    board.run(Time::from_ms(30));
    let stats = board.stats();
    // 22.02 ms at 16 MHz, but for the cycles of the instruction itself.
    let stalled = stats.flash.stalled_cycles;
    assert!((352_310..=352_321).contains(&stalled), "{stalled}");
    assert!(turns(&board) > 10_000, "it goes on afterwards");
    let taken = board.word(SRAM + 4).unwrap_or(0);
    assert!((7..=9).contains(&taken), "{taken}");
    assert!(board.diagnostics().is_empty(), "{:?}", board.diagnostics());

    // The other way round: a reader of bank 2 waits for bank 2.
    let mut board = Program::default()
        .unlocks()
        .store(CR, ERASE_0_OF_BANK_2)
        .then(copy(BANK2, SRAM + 8))
        .counts()
        .board_with(FlashOptions::default());
    board.run(Time::from_ms(22));
    assert_eq!(board.word(SRAM + 8), Some(0xA5A5_A5A5));
    board.run(Time::from_ms(23));
    assert_eq!(board.word(SRAM + 8), Some(u32::MAX));
    assert!(board.stats().flash.stalled_cycles > 352_000);
}

/// Programs the first double word of bank 2.
fn storing() -> Program {
    Program::default()
        .unlocks()
        .store(CR, 1)
        .store(BANK2, HALVES[0])
        .store(BANK2 + 4, HALVES[1])
}

fn first_word(contents: &BankContents) -> [u8; 8] {
    contents.bytes()[..8].try_into().expect("eight bytes")
}

#[test]
fn what_bank_2_holds_survives_resets_the_supply_and_the_board() {
    let expected = 0x0123_4567_89AB_CDEF_u64.to_le_bytes();
    let mut board = storing().sleeps().board();
    board.run(Time::from_ms(1));
    assert_eq!(first_word(&board.bank2()), expected);
    for power in [false, true] {
        if power {
            board.power_off();
        } else {
            board.hold_in_reset();
        }
        assert_eq!(first_word(&board.bank2()), expected);
        board.release_reset();
    }
    let handed_on = FlashOptions {
        bank2: Some(board.bank2()),
        ..FlashOptions::default()
    };
    let mut next = Program::default()
        .then(copy(BANK2, SRAM))
        .then(copy(BANK2 + 4, SRAM + 4))
        .sleeps()
        .board_with(handed_on);
    next.run(Time::from_ms(1));
    assert_eq!(
        [next.word(SRAM), next.word(SRAM + 4)],
        HALVES.map(Some),
        "the core reads it"
    );
    assert!(next.diagnostics().is_empty(), "{:?}", next.diagnostics());
}

#[test]
fn the_end_of_an_operation_interrupts() {
    // EOPIE with PER and the page; STRT with it.
    let mut handler = store(SR, 1);
    handler.extend(count(SRAM));
    let mut board = Program::default()
        .store(SRAM, 0)
        .store(NVIC_ISER0, 1 << irqs::FLASH)
        .unlocks()
        .store(CR, 1 << 24 | ERASE_0_OF_BANK_2)
        .sleeps()
        .handler(FLASH_EXCEPTION, handler)
        .board();
    board.run(Time::from_ms(22));
    assert_eq!(board.word(SRAM), Some(0));
    board.run(Time::from_ms(23));
    assert_eq!(board.word(SRAM), Some(1));
    let stats = board.stats();
    assert_eq!(stats.irq(irqs::FLASH).expect("was taken").name, "FLASH");
}

/// A board whose power went while it programmed, with the double word
/// unreadable.
fn torn() -> BankContents {
    (0..32)
        .map(|seed| {
            let mut board = storing().sleeps().board_with(FlashOptions {
                seed,
                ..FlashOptions::default()
            });
            board.run(Time::from_us(40));
            board.power_off();
            assert_eq!(board.stats().flash.cut, 1);
            board.bank2()
        })
        .find(|contents| contents.unreadable().next() == Some(0))
        .expect("with some seed")
}

#[test]
fn reading_what_a_power_cut_tore_is_a_non_maskable_interrupt() {
    let mut handler = copy(ECCR, SRAM + 4);
    handler.extend(store(ECCR, 1 << 31));
    handler.extend(count(SRAM));
    let options = FlashOptions {
        bank2: Some(torn()),
        ..FlashOptions::default()
    };
    let mut board = Program::default()
        .store(SRAM, 0)
        .then([CPSID_I])
        .then(copy(BANK2 + 8, SRAM + 8))
        .then(copy(BANK2 + 4, SRAM + 8))
        .sleeps()
        .handler(NMI, handler)
        .board_with(options);
    board.run(Time::from_ms(1));
    assert_eq!(board.word(SRAM), Some(1), "once, and not for its neighbour");
    assert_eq!(
        board.word(SRAM + 4),
        Some(1 << 31 | 1 << 21),
        "ECCD, BK_ECC"
    );
}

#[test]
fn a_stray_write_to_the_program_is_told_and_does_nothing() {
    let mut board = Program::default()
        .store(FLASH_BASE + 0x1000, 0)
        .store(BANK2, 0)
        .then(copy(SR, SRAM))
        .sleeps()
        .board();
    assert_eq!(board.run(Time::from_ms(1)), Stop::Reached);
    assert_eq!(board.word(FLASH_BASE + 0x1000), Some(u32::MAX));
    assert_eq!(board.word(SRAM), Some(1 << 7), "PGSERR");
    let entries = board.diagnostics();
    assert_eq!(entries.len(), 1);
    assert_eq!(
        (entries[0].kind, entries[0].count),
        (DiagnosticKind::Flash, 2)
    );
    assert!(entries[0].text.contains("stray pointer"));
}
