//! The PDOs of an axis as this master exchanges them every cycle:
//!
//! | PDO | entries |
//! |---|---|
//! | RPDO1 | controlword 6040h, target velocity 60FFh |
//! | RPDO2 | profile acceleration 6083h, profile deceleration 6084h |
//! | TPDO1 | statusword 6041h, position actual value 6064h |
//! | TPDO2 | velocity actual value 606Ch, torque actual value 6077h |

use super::od::TPDOS_PER_AXIS;
use crate::frame::{Frame, MAX_DATA};
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::motion::{AxisCommand, AxisFeedback};
use crate::network::{Network, Node, Pdo};
use crate::objects;
use crate::pdo::MappingEntry;

const BITS_PER_BYTE: u32 = 8;

const fn mapped(at: Address, bits: u8) -> MappingEntry {
    MappingEntry::new(at.index.0, at.sub.0, bits)
}

const RPDO1: [MappingEntry; 2] = [
    mapped(objects::CONTROLWORD, 16),
    mapped(objects::TARGET_VELOCITY, 32),
];
const RPDO2: [MappingEntry; 2] = [
    mapped(objects::PROFILE_ACCELERATION, 32),
    mapped(objects::PROFILE_DECELERATION, 32),
];
const TPDO1: [MappingEntry; 2] = [
    mapped(objects::STATUSWORD, 16),
    mapped(objects::POSITION_ACTUAL, 32),
];
const TPDO2: [MappingEntry; 2] = [
    mapped(objects::VELOCITY_ACTUAL, 32),
    mapped(objects::TORQUE_ACTUAL, 16),
];

/// Whether the PDOs of `node` are those of the table above.
pub fn fits(node: &Node) -> bool {
    let is = |pdos: &[Pdo], number: u8, expected: &[MappingEntry]| {
        pdos.iter()
            .any(|pdo| pdo.number == number && pdo.mapping == expected)
    };
    is(node.rpdos, 1, &RPDO1)
        && is(node.rpdos, 2, &RPDO2)
        && is(node.tpdos, 1, &TPDO1)
        && is(node.tpdos, 2, &TPDO2)
}

/// The bytes of the TPDOs of each axis of `network`, as mapped; 0 where there
/// is none.
pub fn lengths<const AXES: usize>(network: &Network) -> [[u8; TPDOS_PER_AXIS]; AXES] {
    let mut lengths = [[0; TPDOS_PER_AXIS]; AXES];
    for (lengths, node) in lengths.iter_mut().zip(network.nodes) {
        for (length, number) in lengths.iter_mut().zip(1..) {
            let pdo = node.tpdos.iter().find(|pdo| pdo.number == number);
            let entries = pdo.map_or(&[] as &[_], |pdo| pdo.mapping);
            let bits: u32 = entries.iter().map(|entry| u32::from(entry.bits())).sum();
            *length = (bits / BITS_PER_BYTE) as u8;
        }
    }
    lengths
}

/// What the two TPDOs of an axis say. `fresh`: both came with this SYNC.
pub fn feedback(tpdo1: [u8; MAX_DATA], tpdo2: [u8; MAX_DATA], fresh: bool) -> AxisFeedback {
    let [s0, s1, p0, p1, p2, p3, ..] = tpdo1;
    let [v0, v1, v2, v3, t0, t1, ..] = tpdo2;
    AxisFeedback {
        statusword: u16::from_le_bytes([s0, s1]),
        position: i32::from_le_bytes([p0, p1, p2, p3]),
        velocity: i32::from_le_bytes([v0, v1, v2, v3]),
        torque: i16::from_le_bytes([t0, t1]),
        fresh,
    }
}

/// RPDO1 for `node`.
pub fn rpdo1(node: NodeId, command: &AxisCommand) -> Frame {
    let id = CobId::of(FunctionCode::Rpdo1, node);
    let [c0, c1] = command.controlword.to_le_bytes();
    let [v0, v1, v2, v3] = command.velocity.to_le_bytes();
    // Six bytes always fit.
    Frame::data_frame(id, &[c0, c1, v0, v1, v2, v3]).unwrap_or(Frame::empty(id))
}

/// RPDO2 for `node`.
pub fn rpdo2(node: NodeId, command: &AxisCommand) -> Frame {
    let [a0, a1, a2, a3] = command.acceleration.to_le_bytes();
    let [d0, d1, d2, d3] = command.deceleration.to_le_bytes();
    Frame::full(
        CobId::of(FunctionCode::Rpdo2, node),
        [a0, a1, a2, a3, d0, d1, d2, d3],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::sample::SIX_EPOS4;

    #[test]
    fn the_sample_network_has_these_pdos() {
        assert!(SIX_EPOS4.nodes.iter().all(fits));
        assert_eq!(lengths::<6>(&SIX_EPOS4), [[6, 6]; 6]);
        // A master of more axes than nodes expects nothing from the rest.
        assert_eq!(lengths::<7>(&SIX_EPOS4)[6], [0, 0]);
    }

    #[test]
    fn golden_bytes_both_ways() {
        let command = AxisCommand {
            controlword: 0x000F,
            velocity: -1200,
            acceleration: 1500,
            deceleration: 0x0102_0304,
        };
        let node = NodeId::constant::<3>();
        let frame = rpdo1(node, &command);
        assert_eq!(frame.id().get(), 0x203);
        assert_eq!(frame.data(), [0x0F, 0x00, 0x50, 0xFB, 0xFF, 0xFF]);
        let frame = rpdo2(node, &command);
        assert_eq!(frame.id().get(), 0x303);
        assert_eq!(frame.data(), [0xDC, 0x05, 0, 0, 4, 3, 2, 1]);

        let got = feedback(
            [0x37, 0x16, 0xFE, 0xFF, 0xFF, 0xFF, 0xAA, 0xAA],
            [0xE8, 0x03, 0, 0, 0x9C, 0xFF, 0xAA, 0xAA],
            true,
        );
        let expected = AxisFeedback {
            statusword: 0x1637,
            position: -2,
            velocity: 1000,
            torque: -100,
            fresh: true,
        };
        assert_eq!(got, expected);
    }
}
