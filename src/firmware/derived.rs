//! What follows from the description of the machine, `network.toml`: worked out by
//! the build script and the compiler, so that it lies in flash.

use canmaster::{
    design,
    master::{AxisPdos, TPDOS_PER_AXIS},
    motion::{GroupConfig, Step, experiment},
    sync::SyncLimits,
};
use nucleo_g474re::can::BitTiming;

#[allow(unreachable_pub, reason = "made for any crate")]
mod generated {
    include!(concat!(env!("OUT_DIR"), "/network.rs"));
}

pub(crate) use generated::{AXES, NETWORK, RPDOS_US, TPDO_DEADLINE_US};

/// The bit timing of the controller.
pub(crate) const BIT_TIMING: BitTiming = {
    let (prescaler, seg1, seg2) = generated::BIT_TIMING;
    match BitTiming::new(prescaler, seg1, seg2) {
        Some(timing) => timing,
        None => panic!("the controller has no such bit timing"),
    }
};

/// Where in its PDOs each object of each axis lies.
pub(crate) static PDOS: [AxisPdos; AXES] = match AxisPdos::of_all(&NETWORK) {
    Some(pdos) => pdos,
    None => panic!("an object is not mapped that an axis cannot be led without"),
};

/// Bytes of the TPDOs of each axis.
pub(crate) static TPDO_BYTES: [[u8; TPDOS_PER_AXIS]; AXES] = AxisPdos::tpdo_bytes(&PDOS);

/// The deadline of the TPDOs, the steps of the axes, and the RPDOs; the cycle, if
/// that is less, as the description was checked for it.
const BUSY_US: u32 = {
    let busy = (TPDO_DEADLINE_US + design::STEPS_US + RPDOS_US) as u32;
    least(busy, NETWORK.cycle.as_micros())
};

const fn least(a: u32, b: u32) -> u32 {
    if a < b { a } else { b }
}

/// What the firmware can do of 1006h and 1007h: the shortest period is that of the
/// description's check, the longest what the timers count.
pub(crate) const SYNC_LIMITS: SyncLimits = SyncLimits {
    shortest_period: if generated::SHORTEST_CYCLE_US > BUSY_US {
        generated::SHORTEST_CYCLE_US
    } else {
        BUSY_US
    },
    longest_period: design::LONGEST_CYCLE_US,
    shortest_window: BUSY_US,
};

/// Frames that may wait for a transmit buffer.
pub(crate) const TX_QUEUE: usize = design::tx_queue(AXES);

static STEPS: [Step<AXES>; 3] = experiment::steps(&generated::MOTORS);

/// The axes and their program.
pub(crate) static GROUP: GroupConfig<AXES> = experiment::group(
    &generated::MOTORS,
    NETWORK.cycle,
    generated::TPDO_MISSING_LIMIT,
    &STEPS,
);
