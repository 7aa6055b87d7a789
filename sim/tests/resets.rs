//! The board dies in motion: the drives stop, and nothing moves without a new
//! release. `cargo xtask campaign` does this with many more seeds.

mod common;

use canmaster_sim::board::irqs;
use canmaster_sim::time::Time;
use canmaster_sim::world::Stimulus;
use canmaster_sim::world::trials::{hang_in_motion, moving, reset_in_motion};

use common::image;

#[test]
fn resets_of_a_millisecond_and_of_two_seconds_end_in_standstill() {
    for (seed, ms) in [(11, 1), (12, 2000)] {
        reset_in_motion(image(), seed, Time::from_ms(100), Time::from_ms(ms))
            .unwrap_or_else(|error| panic!("{ms} ms: {error}"));
    }
}

#[test]
fn a_task_that_hangs_is_found_by_the_watchdog() {
    for (seed, irq) in [
        (13, irqs::TIM7),
        (14, irqs::TIM3),
        (16, irqs::FDCAN1_IT0),
        (17, irqs::TIM2),
        (18, irqs::UART4),
    ] {
        hang_in_motion(image(), seed, irq).unwrap_or_else(|error| panic!("{irq}: {error}"));
    }
}

#[test]
fn the_drives_stop_when_the_master_dies_for_good() {
    let mut world = moving(image(), 15).unwrap();
    world.apply(Stimulus::Reset(true));
    // Consumer time 200 ms, quick-stop ramp 0.3 s at most.
    let limit = world.now() + Time::from_ms(700);
    assert!(world.run_to(limit, |world| world.at_rest()));
    for status in world.statuses().flatten() {
        // EPOS4: heartbeat error.
        assert_eq!(status.last_emcy, Some(0x8130), "node {}", status.node.get());
    }
}
