//! From TPDOs to values, and from commands to RPDOs.

use std::hint::black_box;

use canmaster::NodeId;
use canmaster::master::{AxisPdos, MasterOd, TPDOS_PER_AXIS, TpdoSlot};
use canmaster::motion::AxisCommand;
use canmaster::motion::mode::Mode;
use canmaster::network::sample::SIX_EPOS4_10_MS as SIX_EPOS4;

const AXES: usize = 6;
const NODE: NodeId = NodeId::constant::<1>();

static PDOS: [AxisPdos; AXES] = match AxisPdos::of_all(&SIX_EPOS4) {
    Some(pdos) => pdos,
    None => panic!("the sample maps what an axis needs"),
};
static TPDO_BYTES: [[u8; TPDOS_PER_AXIS]; AXES] = AxisPdos::tpdo_bytes(&PDOS);

const TPDO: [u8; 8] = [0x37, 0x16, 1, 2, 3, 4, 0, 0];
const BYTES: usize = 6;

fn slots() -> impl Iterator<Item = TpdoSlot> + Clone {
    let all = (0..AXES).flat_map(|axis| (0..TPDOS_PER_AXIS).map(move |n| (axis, n)));
    all.filter_map(|(axis, number)| TpdoSlot::new(axis, number))
}

fn opened() -> MasterOd<AXES> {
    let mut od = MasterOd::new(&TPDO_BYTES);
    od.follow(1);
    od
}

/// A TPDO of a cycle.
pub(crate) fn store(times: u32) {
    let mut od = opened();
    for slot in slots().cycle().take(times as usize) {
        black_box(od.store(black_box(slot), black_box(TPDO), BYTES));
    }
}

/// A cycle that opens and is taken at the deadline.
pub(crate) fn take_cycle(times: u32) {
    let mut od = opened();
    for sync in 1..=times {
        od.follow(black_box(sync));
        black_box(od.take_cycle(true, black_box(true)));
    }
}

/// Of one axis.
pub(crate) fn feedback(times: u32) {
    let [pdos, ..] = &PDOS;
    let mut od = opened();
    for slot in slots() {
        od.store(slot, TPDO, BYTES);
    }
    for _ in 0..times {
        black_box(black_box(pdos).feedback(black_box(od.image(0)), true));
    }
}

/// The RPDO of one axis in a cycle.
pub(crate) fn rpdo(times: u32) {
    let [pdos, ..] = &PDOS;
    let command = AxisCommand {
        mode: Mode::ProfileVelocity,
        controlword: 0x000F,
        target: -1200,
        acceleration: 1500,
        deceleration: 1500,
    };
    for _ in 0..times {
        black_box(black_box(pdos).cyclic(black_box(&command), NODE));
    }
}
