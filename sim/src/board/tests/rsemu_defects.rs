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
