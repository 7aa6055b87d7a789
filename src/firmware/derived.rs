//! What follows from the description of the machine, `network.toml`: worked out by
//! the build script and the compiler, so that it lies in flash.

use canmaster::{
    design,
    master::{AxisPdos, TPDOS_PER_AXIS},
    motion::{GroupConfig, experiment},
    sync::SyncLimits,
};
use nucleo_g474re::can::{BitTiming, Controller};

#[allow(unreachable_pub, reason = "made for any crate")]
mod generated {
    include!(concat!(env!("OUT_DIR"), "/network.rs"));
}

pub(crate) use generated::{
    AFTER_SYNC_US, AXES, AXIS_BUSES, BUS_PERIPHERALS, BUSES, HEARTBEATS_IN_OPERATIONAL, NETWORK,
    ONE_PLANNED, PROGRAM, RAMPS_ON_CHANGE, RPDOS_AFTER_SYNC, RPDOS_US, SDO_EVERY, SDO_NEXT_CYCLE,
    TPDO_DEADLINE_US,
};
use generated::{BUS_BIT_TIMINGS, SDO_FROM_US, SDO_UNTIL_US};

/// Before the end of the cycle nothing is begun that could still be on the wire.
pub(crate) const GUARD_US: u32 = generated::GUARD_US as u32;

/// How long the longest frame takes.
pub(crate) const FRAME_US: u32 = {
    const LONGEST_BITS: u32 = 135;
    const SECOND_US: u32 = 1_000_000;
    LONGEST_BITS * SECOND_US / NETWORK.bit_rate
};

/// Whether any RPDO of every cycle waits for the next SYNC.
pub(crate) const EARLY: bool = {
    let (mut early, mut axis) = (RPDOS_AFTER_SYNC, 0);
    while axis < AXES {
        early |= !RAMPS_ON_CHANGE[axis];
        axis += 1;
    }
    early
};

/// When SDO requests may be sent on each bus: from, and before, in microseconds
/// after SYNC.
pub(crate) const SDO_US: [(u16, u16); BUSES] = {
    let (mut all, mut bus) = ([(0, 0); BUSES], 0);
    while bus < BUSES {
        all[bus] = (SDO_FROM_US[bus], SDO_UNTIL_US[bus]);
        bus += 1;
    }
    all
};

/// When the first of the windows begins that is not open from the SYNC on, in
/// microseconds after it; 0: there is none.
pub(crate) const WINDOW_US: u16 = {
    let (mut first, mut bus) = (0, 0);
    while bus < BUSES {
        if SDO_FROM_US[bus] > first {
            first = SDO_FROM_US[bus];
        }
        bus += 1;
    }
    first
};

/// The board's own TPDOs have half of the planned slots where there is one in a cycle:
/// so many SYNCs from one to the next, at least, of each of the four.
pub(crate) const TPDO_EVERY: u8 = {
    let (mut planned, mut bus) = (false, 0);
    while bus < BUSES {
        planned |= ONE_PLANNED[bus];
        bus += 1;
    }
    if planned { 2 * 4 } else { 1 }
};

/// The controller of each bus.
pub(crate) const CONTROLLERS: [Controller; BUSES] = {
    let (mut all, mut bus) = ([Controller::FDCAN1; BUSES], 0);
    while bus < BUSES {
        all[bus] = match Controller::fdcan(BUS_PERIPHERALS[bus]) {
            Some(controller) => controller,
            None => panic!("the chip has no such controller"),
        };
        bus += 1;
    }
    all
};

/// The bus of a controller, counted from 0.
pub(crate) const fn bus_of(peripheral: u8) -> usize {
    let mut bus = 0;
    while bus < BUSES && BUS_PERIPHERALS[bus] != peripheral {
        bus += 1;
    }
    bus
}

/// The controllers that are used, FDCAN1 being bit 0.
pub(crate) const CAN: u8 = {
    let (mut bits, mut bus) = (0, 0);
    while bus < BUSES {
        bits |= 1 << (BUS_PERIPHERALS[bus] - 1);
        bus += 1;
    }
    bits
};

/// The bit timing of a controller; of the first bus if it has none.
pub(crate) const fn bit_timing(peripheral: u8) -> BitTiming {
    let bus = bus_of(peripheral);
    let (prescaler, seg1, seg2) = BUS_BIT_TIMINGS[if bus < BUSES { bus } else { 0 }];
    match BitTiming::new(prescaler, seg1, seg2) {
        Some(timing) => timing,
        None => panic!("the controller has no such bit timing"),
    }
}

/// Where in its PDOs each object of each axis lies.
const ALL_PDOS: [AxisPdos; AXES] = match AxisPdos::of_all(&NETWORK) {
    Some(pdos) => pdos,
    None => panic!("an object is not mapped that an axis cannot be led without"),
};

const KINDS: usize = if generated::PDOS_ALIKE { 1 } else { AXES };

/// Once where all are alike, else of each axis.
static PDOS: [AxisPdos; KINDS] = {
    let mut pdos = [ALL_PDOS[0]; KINDS];
    let mut n = 0;
    while n < KINDS {
        pdos[n] = ALL_PDOS[n];
        n += 1;
    }
    pdos
};

/// Where in its PDOs each object of an axis lies.
#[inline(always)]
pub(crate) fn pdos(axis: usize) -> Option<&'static AxisPdos> {
    PDOS.get(if generated::PDOS_ALIKE { 0 } else { axis })
}

/// Bytes of the TPDOs of each axis.
pub(crate) static TPDO_BYTES: [[u8; TPDOS_PER_AXIS]; AXES] = AxisPdos::tpdo_bytes(&ALL_PDOS);

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

/// The axes as the group leads them.
pub(crate) static GROUP: GroupConfig<AXES> = experiment::group(
    &generated::MOTORS,
    NETWORK.cycle,
    generated::TPDO_MISSING_LIMIT,
);
