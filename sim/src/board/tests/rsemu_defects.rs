//! What `rsemu` 0.0.7 does differently from the hardware, shown on its own, so
//! that the day it changes the work-around can go.

use rsemu::core::device::{Device as _, ResetKind};
use rsemu::cpu::arm::v7m::sys::Exception;
use rsemu::cpu::arm::v7m::{ArmV7m, Config};

/// A system reset clears the NVIC's enables (DDI 0403, B1.5.5); the emulator's
/// warm reset leaves them. `Board::reset` takes the cold one for every cause.
#[test]
fn a_warm_reset_leaves_the_nvic_enabled() {
    const TIM2: Exception = Exception(16 + 28);
    let core = ArmV7m::new(Config::CORTEX_M4F);
    core.with_sys(|sys| sys.set_enable(TIM2, true));
    core.reset(ResetKind::Warm);
    assert!(core.with_sys(|sys| sys.is_enabled(TIM2)));
    core.reset(ResetKind::Cold);
    assert!(!core.with_sys(|sys| sys.is_enabled(TIM2)));
}

/// Exception entry is documented to take twelve cycles, which is what stacking
/// takes as a whole; the emulator adds one for each of its eight stores.
/// `Board::step` takes them off again.
#[test]
fn exception_entry_is_charged_twenty_cycles() {
    use rsemu::core::space::{AddressSpace, RamStore, Region};
    use std::sync::Arc;
    const SVC: u16 = 0xDF00;
    let ram = Arc::new(RamStore::new(0x1000));
    for (at, word) in [(0x00, 0x1000), (0x04, 0x101), (0x2C, 0x201)] {
        ram.write_at(at, &u32::to_le_bytes(word)).expect("in range");
    }
    ram.write_at(0x100, &SVC.to_le_bytes()).expect("in range");
    let space = AddressSpace::new("test", 32);
    space
        .topology()
        .map(Region::ram("ram", ram), 0)
        .expect("maps");
    let core = ArmV7m::new(Config::CORTEX_M4F);
    core.attach_space(Arc::new(space));
    core.step();
    assert_eq!(core.step(), 1 + 12 + 8, "SVC, then the entry");
}

/// An exception within an IF-THEN block stacks the block's state with xPSR, and
/// the return goes on with it (DDI 0403, B1.5.6). The emulator stacks zeros and
/// then runs the rest of the block unconditionally; `Board::step` puts the
/// state back.
#[test]
fn an_interrupt_within_an_if_then_block_does_not_end_it() {
    use super::{Program, SRAM, TIM_SR, TIM2, TIM2_EXCEPTION, load, store};
    use crate::time::Time;
    const MOVS_R2_0: u16 = 0x2200;
    const MOVS_R3_0: u16 = 0x2300;
    const CMP_R2_1: u16 = 0x2A01;
    const ITTTT_EQ: u16 = 0xBF01;
    const ADDEQ_R3_1: u16 = 0x3301;
    const BRANCH_TO_CMP: u16 = 0xE7F8;
    const STR_R3_R0: u16 = 0x6003;

    let mut handler = store(TIM2 + TIM_SR, 0);
    handler.extend(load(0, SRAM));
    handler.push(STR_R3_R0);
    // 101 is a prime: the interrupts fall on every instruction of the loop.
    let mut board = Program::default()
        .tim2_every(101)
        .then([MOVS_R2_0, MOVS_R3_0, CMP_R2_1, ITTTT_EQ])
        .then([ADDEQ_R3_1; 4])
        .then([BRANCH_TO_CMP])
        .handler(TIM2_EXCEPTION, handler)
        .board();
    board.run(Time::from_ms(10));
    assert!(board.stats().irq(28).expect("was taken").count > 1000);
    assert_eq!(board.word(SRAM), Some(0), "r2 is never 1");
}

/// What a comparison of the FPU has found outlives an interrupt whose handler does
/// not use it (DDI 0403, B1.5.7). The emulator clears FPSCR at the entry;
/// `Board::step` puts it back.
#[test]
fn an_interrupt_after_a_comparison_does_not_change_what_it_found() {
    use super::{Program, SRAM, TIM_SR, TIM2, TIM2_EXCEPTION, load, store};
    use crate::time::Time;
    const CPACR: u32 = 0xE000_ED88;
    const FULL_ACCESS: u32 = 0xF << 20;
    const MOVS_R3_0: u16 = 0x2300;
    const VMOV_S0_1: [u16; 2] = [0xEEB7, 0x0A00];
    const VMOV_S1_HALF: [u16; 2] = [0xEEF6, 0x0A00];
    const VCMP_S0_S1: [u16; 2] = [0xEEB4, 0x0A60];
    const VMRS_APSR: [u16; 2] = [0xEEF1, 0xFA10];
    const IT_CC: u16 = 0xBF38;
    const ADDCC_R3_1: u16 = 0x3301;
    const BRANCH_TO_VCMP: u16 = 0xE7F8;
    const STR_R3_R0: u16 = 0x6003;

    let mut handler = store(TIM2 + TIM_SR, 0);
    handler.extend(load(0, SRAM));
    handler.push(STR_R3_R0);
    let mut board = Program::default()
        .store(CPACR, FULL_ACCESS)
        .tim2_every(101)
        .then(VMOV_S0_1)
        .then(VMOV_S1_HALF)
        .then([MOVS_R3_0])
        .then(VCMP_S0_S1)
        .then(VMRS_APSR)
        .then([IT_CC, ADDCC_R3_1, BRANCH_TO_VCMP])
        .handler(TIM2_EXCEPTION, handler)
        .board();
    board.run(Time::from_ms(10));
    assert!(board.stats().irq(28).expect("was taken").count > 1000);
    assert_eq!(board.word(SRAM), Some(0), "1 is never less than a half");
}
