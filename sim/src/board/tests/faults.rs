use super::super::{FaultKind, ResetCause};
use super::*;

fn fault_of(program: Program) -> super::super::FaultReport {
    match program.board().run(Time::from_ms(10)) {
        Stop::Fault(report) => *report,
        other => panic!("no fault but {other:?}"),
    }
}

#[test]
fn an_undefined_instruction_is_told_with_its_place() {
    let report = fault_of(Program::default().then([NOP, UDF]));
    assert_eq!(report.kind, FaultKind::HardFault);
    assert_eq!(report.pc, FLASH_BASE + CODE as u32 + 2);
    let words = report.to_string();
    assert!(words.contains("undefined instruction"), "{words}");
    assert!(words.contains("0x08000202"), "{words}");
}

#[test]
fn a_stack_overflow_reaches_nothing_and_faults() {
    // MOV sp, r0 to the bottom of the SRAM, then PUSH {r0}.
    let report = fault_of(
        Program::default()
            .then(load(0, 0x2000_0000))
            .then([0x4685, 0xB401]),
    );
    assert_eq!(report.address, Some(0x1FFF_FFFC));
}

#[test]
fn a_fault_in_the_fault_handler_locks_the_core_up() {
    let mut board = Program::default().then([UDF]).handler(3, [UDF]).board();
    let first = board.run(Time::from_ms(1));
    assert!(matches!(first, Stop::Fault(report) if report.kind == FaultKind::HardFault));
    let second = board.run(Time::from_ms(1));
    assert!(matches!(second, Stop::Fault(report) if report.kind == FaultKind::LockUp));
    assert_eq!(board.run(Time::from_s(100)), Stop::Reached, "time goes on");
}

/// Starts the watchdog at its longest LSI period of some 512 ms.
fn watchdog(program: Program) -> Program {
    program.store(IWDG, 0xCCCC)
}

#[test]
fn the_watchdog_resets_a_locked_up_core() {
    let program = Program::default().then(copy(RCC_CSR, SRAM));
    let mut board = watchdog(program).then([UDF]).handler(3, [UDF]).board();
    while board.run(Time::from_ms(600)) != Stop::Reached {}
    assert_eq!(
        board.word(SRAM),
        Some(0x2C00_0000),
        "IWDGRSTF, PINRSTF, BORRSTF"
    );
    let resets = board.stats().resets;
    assert_eq!(resets[1].cause, ResetCause::Watchdog);
    // 4096 ticks of 125 us.
    assert_eq!(resets[1].at.as_ms(), 512);
}

#[test]
fn the_watchdog_leaves_a_fed_program_alone() {
    let mut handler = store(TIM2 + TIM_SR, 0);
    handler.extend(store(IWDG, 0xAAAA));
    let mut board = watchdog(Program::default())
        .tim2_every(1_600_000)
        .sleeps()
        .handler(TIM2_EXCEPTION, handler)
        .board();
    board.run(Time::from_s(5));
    assert_eq!(board.stats().resets.len(), 1);
}

#[test]
fn a_software_reset_keeps_ram_and_clears_the_nvic() {
    // The first run marks RAM and resets; the second, finding the mark, sleeps
    // with TIM2 pending but, as after every reset, not enabled.
    let mut board = Program::default()
        .then(copy(NVIC_ISER0, SRAM + 8))
        .then(count(SRAM))
        .then(load(2, 2 + 0xA5A5_A5A5))
        // CMP r1, r2; BEQ over the two stores and the branch.
        .then([0x4291, 0xD000 | 18])
        .store(NVIC_ISER0, 1 << 28)
        .store(AIRCR, 0x05FA_0004)
        .then([BRANCH_TO_SELF])
        .store(NVIC_ISPR0, 1 << 28)
        .sleeps()
        .board();
    board.run(Time::from_ms(10));
    assert_eq!(
        board.word(SRAM),
        Some(0xA5A5_A5A5 + 2),
        "two runs on the same RAM"
    );
    assert_eq!(board.word(SRAM + 8), Some(0), "NVIC enables are reset");
    let causes: Vec<_> = board
        .stats()
        .resets
        .iter()
        .map(|reset| reset.cause)
        .collect();
    assert_eq!(causes, [ResetCause::PowerOn, ResetCause::Software]);
}

#[test]
fn without_power_ram_is_lost() {
    let mut board = Program::default().then(count(SRAM)).sleeps().board();
    board.run(Time::from_ms(1));
    board.power_off();
    board.run(Time::from_ms(2));
    assert!(board.is_held());
    board.release_reset();
    board.run(Time::from_ms(3));
    assert_eq!(board.word(SRAM), Some(0xA5A5_A5A6));
    assert_eq!(board.stats().resets[1].cause, ResetCause::PowerOn);
}
