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

/// What a description may ask for and the firmware does not do is refused here.
const _: () = {
    let [controller] = generated::BUS_PERIPHERALS;
    assert!(generated::BUSES == 1 && controller == 1, "it drives FDCAN1");
    let [(prescaler, ..)] = generated::BUS_BIT_TIMINGS;
    assert!(
        prescaler == generated::BIT_TIMING.0,
        "one bus, one bit timing"
    );
    let [bus, ..] = generated::AXIS_BUSES;
    assert!(bus == 0, "all axes are on the first bus");
    assert!(
        !generated::RPDOS_AFTER_SYNC,
        "it sends RPDOs after the TPDOs"
    );
    let ([false], [from], [until], [false], [0]) = (
        generated::ONE_PLANNED,
        generated::SDO_FROM_US,
        generated::SDO_UNTIL_US,
        generated::SDO_NEXT_CYCLE,
        generated::SDO_EVERY,
    ) else {
        panic!("it does not plan SDO frames");
    };
    assert!(from <= until);
    let [after_sync] = generated::AFTER_SYNC_US;
    assert!(after_sync as u32 + generated::GUARD_US as u32 <= NETWORK.cycle.as_micros());
    let [true, ..] = generated::RAMPS_ON_CHANGE else {
        panic!("it sends ramps on change");
    };
    let [true, ..] = generated::HEARTBEATS_IN_OPERATIONAL else {
        panic!("it lets heartbeats run");
    };
};

/// Where in its PDOs each object of each axis lies.
pub(crate) static PDOS: [AxisPdos; AXES] = match AxisPdos::of_all(&NETWORK) {
    Some(pdos) => pdos,
    None => panic!("an object is not mapped that an axis cannot be led without"),
};

/// Bytes of the TPDOs of each axis.
pub(crate) static TPDO_BYTES: [[u8; TPDOS_PER_AXIS]; AXES] = AxisPdos::tpdo_bytes(&PDOS);

/// What the firmware takes for 1006h and 1007h: the periods that pass the check of
/// the description, and a window that holds the deadline of the TPDOs, the steps of
/// the axes and the RPDOs.
pub(crate) const SYNC_LIMITS: SyncLimits = SyncLimits {
    shortest_period: generated::SHORTEST_CYCLE_US,
    longest_period: generated::LONGEST_CYCLE_US,
    shortest_window: (TPDO_DEADLINE_US + generated::COMPUTE_US + RPDOS_US) as u32,
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
