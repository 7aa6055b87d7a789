//! The PDOs of an axis as this master exchanges them every cycle: where in RPDO1,
//! RPDO2, TPDO1 and TPDO2 each object lies follows from the network's mapping.
//!
//! | direction | objects |
//! |---|---|
//! | to the drive | controlword 6040h, target velocity 60FFh, profile acceleration 6083h, profile deceleration 6084h |
//! | from the drive | statusword 6041h, position 6064h; velocity 606Ch and torque 6077h may be left out |

use super::od::{IMAGE_BYTES, TPDOS_PER_AXIS};
use crate::frame::{Frame, MAX_DATA};
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::motion::{AxisCommand, AxisFeedback};
use crate::network::{Network, Node, Pdo};
use crate::objects;
use crate::pdo::MappingEntry;

/// PDOs of each direction.
const PDOS: usize = TPDOS_PER_AXIS;

const fn entry(at: Address, bits: u8) -> MappingEntry {
    MappingEntry::new(at.index.0, at.sub.0, bits)
}

const CONTROLWORD: MappingEntry = entry(objects::CONTROLWORD, 16);
const TARGET_VELOCITY: MappingEntry = entry(objects::TARGET_VELOCITY, 32);
const ACCELERATION: MappingEntry = entry(objects::PROFILE_ACCELERATION, 32);
const DECELERATION: MappingEntry = entry(objects::PROFILE_DECELERATION, 32);
const STATUSWORD: MappingEntry = entry(objects::STATUSWORD, 16);
const POSITION: MappingEntry = entry(objects::POSITION_ACTUAL, 32);
const VELOCITY: MappingEntry = entry(objects::VELOCITY_ACTUAL, 32);
const TORQUE: MappingEntry = entry(objects::TORQUE_ACTUAL, 16);

/// Where an object lies: from which byte of the PDOs on, put one behind the other
/// with eight each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place(u8);

/// An object that is not mapped lies behind all that is.
const NOWHERE: Place = Place((MAX_DATA * PDOS) as u8);

/// The objects that an axis sends, as they lie in the PDOs.
type Image = [u8; IMAGE_BYTES];
/// Those that it receives.
pub type RpdoImage = [u8; PDOS * MAX_DATA];

impl Place {
    /// The first place of `wanted` in these PDOs; `None`: not mapped.
    const fn find(pdos: &[Pdo], wanted: MappingEntry) -> Option<Place> {
        let mut left = pdos;
        while let Some((pdo, others)) = left.split_first() {
            let (mut entries, mut bit) = (pdo.mapping, 0);
            while let Some((mapped, more)) = entries.split_first() {
                if mapped.0 == wanted.0 && pdo.number as usize <= PDOS {
                    let first = pdo.number.saturating_sub(1) * MAX_DATA as u8;
                    return Some(Place(first + bit / u8::BITS as u8));
                }
                bit += mapped.bits();
                entries = more;
            }
            left = others;
        }
        None
    }

    /// The same; [`NOWHERE`] if it is not mapped.
    const fn find_or_nowhere(pdos: &[Pdo], wanted: MappingEntry) -> Place {
        match Place::find(pdos, wanted) {
            Some(place) => place,
            None => NOWHERE,
        }
    }

    /// In which PDO, counted from 0.
    const fn pdo(self) -> u8 {
        self.0 / MAX_DATA as u8
    }

    /// The object and what follows it; 0 if it is not mapped.
    #[inline]
    fn read(self, image: &Image) -> u32 {
        let bytes = image
            .get(usize::from(self.0)..)
            .and_then(<[u8]>::first_chunk);
        bytes.map_or(0, |bytes| u32::from_le_bytes(*bytes))
    }

    /// Writes the first bytes of `value`.
    #[inline]
    fn write<const BYTES: usize>(self, image: &mut RpdoImage, value: [u8; BYTES]) {
        let place = image.get_mut(usize::from(self.0)..);
        if let Some(bytes) = place.and_then(<[u8]>::first_chunk_mut) {
            *bytes = value;
        }
    }
}

/// The PDOs of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisPdos {
    /// In the order of [`AxisCommand`].
    commands: [Place; 4],
    /// In the order of [`AxisFeedback`].
    feedback: [Place; 4],
    rpdo_bytes: [u8; PDOS],
    tpdo_bytes: [u8; PDOS],
}

/// Whole bytes of the PDOs; 0 where there is none.
const fn lengths(pdos: &[Pdo]) -> [u8; PDOS] {
    let mut bytes = [0; PDOS];
    let mut left = pdos;
    while let Some((pdo, others)) = left.split_first() {
        let (mut entries, mut bits) = (pdo.mapping, 0);
        while let Some((mapped, more)) = entries.split_first() {
            bits += mapped.bits();
            entries = more;
        }
        let [first, second] = &mut bytes;
        match pdo.number {
            1 => *first = bits / u8::BITS as u8,
            2 => *second = bits / u8::BITS as u8,
            _ => {}
        }
        left = others;
    }
    bytes
}

impl AxisPdos {
    /// Nothing is exchanged.
    const NONE: AxisPdos = AxisPdos {
        commands: [NOWHERE; 4],
        feedback: [NOWHERE; 4],
        rpdo_bytes: [0; PDOS],
        tpdo_bytes: [0; PDOS],
    };

    /// The PDOs as `node` has them mapped. `None` if an object is missing that an
    /// axis cannot be led without.
    pub const fn of(node: &Node) -> Option<AxisPdos> {
        let (
            Some(controlword),
            Some(target),
            Some(acceleration),
            Some(deceleration),
            Some(statusword),
            Some(position),
        ) = (
            Place::find(node.rpdos, CONTROLWORD),
            Place::find(node.rpdos, TARGET_VELOCITY),
            Place::find(node.rpdos, ACCELERATION),
            Place::find(node.rpdos, DECELERATION),
            Place::find(node.tpdos, STATUSWORD),
            Place::find(node.tpdos, POSITION),
        )
        else {
            return None;
        };
        let velocity = Place::find_or_nowhere(node.tpdos, VELOCITY);
        let torque = Place::find_or_nowhere(node.tpdos, TORQUE);
        Some(AxisPdos {
            commands: [controlword, target, acceleration, deceleration],
            feedback: [statusword, position, velocity, torque],
            rpdo_bytes: lengths(node.rpdos),
            tpdo_bytes: lengths(node.tpdos),
        })
    }

    /// Those of every axis of `network`. `None` if there are not `AXES`, or an
    /// object is missing that an axis cannot be led without.
    pub const fn of_all<const AXES: usize>(network: &Network) -> Option<[AxisPdos; AXES]> {
        let mut all = [AxisPdos::NONE; AXES];
        let (mut left, mut nodes): (&mut [AxisPdos], &[Node]) = (&mut all, network.nodes);
        if left.len() != nodes.len() {
            return None;
        }
        while let (Some((pdos, more)), Some((node, others))) =
            (left.split_first_mut(), nodes.split_first())
        {
            *pdos = match AxisPdos::of(node) {
                Some(found) => found,
                None => return None,
            };
            (left, nodes) = (more, others);
        }
        Some(all)
    }

    /// The bytes of the TPDOs of each axis; 0 where there is none.
    pub const fn tpdo_bytes<const AXES: usize>(
        all: &[AxisPdos; AXES],
    ) -> [[u8; TPDOS_PER_AXIS]; AXES] {
        let mut bytes = [[0; TPDOS_PER_AXIS]; AXES];
        let (mut left, mut axes): (&mut [[u8; TPDOS_PER_AXIS]], &[AxisPdos]) = (&mut bytes, all);
        while let (Some((of_axis, more)), Some((axis, others))) =
            (left.split_first_mut(), axes.split_first())
        {
            *of_axis = axis.tpdo_bytes;
            (left, axes) = (more, others);
        }
        bytes
    }

    /// Whether a TPDO carries the velocity. If none does, it is for a
    /// [`Speedometer`](crate::motion::Speedometer) to find out.
    pub const fn has_velocity(&self) -> bool {
        let [_, _, velocity, _] = &self.feedback;
        velocity.0 != NOWHERE.0
    }

    /// What the TPDOs of the axis say. `fresh`: all came with this SYNC.
    pub fn feedback(&self, image: &Image, fresh: bool) -> AxisFeedback {
        let [statusword, position, velocity, torque] = self.feedback;
        AxisFeedback {
            statusword: statusword.read(image) as u16,
            position: position.read(image) as i32,
            velocity: velocity.read(image) as i32,
            torque: torque.read(image) as i16,
            fresh,
        }
    }

    /// Whether the RPDO `number`, counted from 0, carries nothing but ramps: it
    /// is sent when they change.
    pub fn has_only_ramps(&self, number: u8) -> bool {
        let [controlword, velocity, ..] = &self.commands;
        controlword.pdo() != number && velocity.pdo() != number
    }

    /// The RPDOs of the axis, into `image`.
    #[inline(never)]
    pub fn write(&self, command: &AxisCommand, image: &mut RpdoImage) {
        *image = [0; PDOS * MAX_DATA];
        let [controlword, velocity, acceleration, deceleration] = self.commands;
        controlword.write(image, command.controlword.to_le_bytes());
        velocity.write(image, command.velocity.to_le_bytes());
        acceleration.write(image, command.acceleration.to_le_bytes());
        deceleration.write(image, command.deceleration.to_le_bytes());
    }

    /// The same, by value.
    pub fn image(&self, command: &AxisCommand) -> RpdoImage {
        let mut image = RpdoImage::default();
        self.write(command, &mut image);
        image
    }

    /// The RPDO `number`, counted from 0, for `node`. `None`: it has none.
    pub fn rpdo(&self, number: u8, node: NodeId, image: &RpdoImage) -> Option<Frame> {
        let function = match number {
            0 => FunctionCode::Rpdo1,
            _ => FunctionCode::Rpdo2,
        };
        let number = usize::from(number);
        let length = *self.rpdo_bytes.get(number)?;
        let data = image.get(number * MAX_DATA..)?.first_chunk()?;
        let frame = Frame::of_padded(CobId::of(function, node), length, *data);
        (length > 0).then_some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::sample::SIX_EPOS4_10_MS as SIX_EPOS4;

    fn pdos() -> [AxisPdos; 6] {
        AxisPdos::of_all(&SIX_EPOS4).unwrap()
    }

    fn image(tpdos: [[u8; MAX_DATA]; PDOS]) -> Image {
        let mut image = [0; IMAGE_BYTES];
        image[..PDOS * MAX_DATA].copy_from_slice(&tpdos.concat());
        image
    }

    #[test]
    fn the_sample_networks_have_these_pdos() {
        assert_eq!(AxisPdos::tpdo_bytes(&pdos()), [[6, 6]; 6]);
        let fast = AxisPdos::of_all(&crate::network::sample::SIX_EPOS4).unwrap();
        assert_eq!(AxisPdos::tpdo_bytes(&fast), [[6, 0]; 6]);
        assert_eq!(AxisPdos::of_all::<7>(&SIX_EPOS4), None);
    }

    const COMMAND: AxisCommand = AxisCommand {
        controlword: 0x000F,
        velocity: -1200,
        acceleration: 1500,
        deceleration: 0x0102_0304,
    };

    #[test]
    fn golden_bytes_both_ways() {
        let [pdos, ..] = pdos();
        let node = NodeId::constant::<3>();
        let frame = pdos.rpdo(0, node, &pdos.image(&COMMAND)).unwrap();
        assert_eq!(frame.id().get(), 0x203);
        assert_eq!(frame.data(), [0x0F, 0x00, 0x50, 0xFB, 0xFF, 0xFF]);
        let frame = pdos.rpdo(1, node, &pdos.image(&COMMAND)).unwrap();
        assert_eq!(frame.id().get(), 0x303);
        assert_eq!(frame.data(), [0xDC, 0x05, 0, 0, 4, 3, 2, 1]);
        assert_eq!(pdos.rpdo(2, node, &pdos.image(&COMMAND)), None);
        assert!(!pdos.has_only_ramps(0) && pdos.has_only_ramps(1));

        let got = pdos.feedback(
            &image([
                [0x37, 0x16, 0xFE, 0xFF, 0xFF, 0xFF, 0xAA, 0xAA],
                [0xE8, 0x03, 0, 0, 0x9C, 0xFF, 0xAA, 0xAA],
            ]),
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

    /// Another order, another division, a gap, and no torque.
    #[test]
    fn another_mapping() {
        const OTHER: MappingEntry = MappingEntry::new(0x6061, 0, 8);
        const fn pdo(number: u8, mapping: &'static [MappingEntry]) -> Pdo {
            Pdo {
                number,
                transmission: crate::pdo::Transmission::Synchronous(1),
                mapping,
            }
        }
        const RPDOS: &[Pdo] = &[
            pdo(2, &[TARGET_VELOCITY, CONTROLWORD]),
            pdo(1, &[DECELERATION, ACCELERATION]),
        ];
        const TPDOS: &[Pdo] = &[
            pdo(1, &[OTHER, VELOCITY]),
            pdo(2, &[POSITION, OTHER, STATUSWORD]),
        ];
        let node = Node {
            rpdos: RPDOS,
            tpdos: TPDOS,
            ..crate::network::sample::epos4(NodeId::constant::<7>(), "axis 7")
        };
        let pdos = AxisPdos::of(&node).unwrap();
        let frame = pdos.rpdo(0, node.id, &pdos.image(&COMMAND)).unwrap();
        assert_eq!(frame.data(), [4, 3, 2, 1, 0xDC, 0x05, 0, 0]);
        let frame = pdos.rpdo(1, node.id, &pdos.image(&COMMAND)).unwrap();
        assert_eq!(frame.data(), [0x50, 0xFB, 0xFF, 0xFF, 0x0F, 0x00]);
        assert!(pdos.has_only_ramps(0) && !pdos.has_only_ramps(1));
        let tpdos = image([
            [3, 0xE8, 0x03, 0, 0, 0, 0, 0],
            [0xFE, 0xFF, 0xFF, 0xFF, 3, 0x37, 0x16, 0],
        ]);
        let got = pdos.feedback(&tpdos, false);
        assert_eq!((got.statusword, got.position), (0x1637, -2));
        assert_eq!((got.velocity, got.torque), (1000, 0));
        assert_eq!(AxisPdos::tpdo_bytes(&[pdos]), [[5, 7]]);

        assert!(pdos.has_velocity());
        const NO_VELOCITY: &[Pdo] = &[pdo(1, &[STATUSWORD, POSITION])];
        let slow = AxisPdos::of(&Node {
            tpdos: NO_VELOCITY,
            ..node
        });
        let slow = slow.unwrap();
        assert!(!slow.has_velocity());
        assert_eq!(AxisPdos::tpdo_bytes(&[slow]), [[6, 0]]);
        assert_eq!(slow.feedback(&tpdos, true).velocity, 0);

        let blind = Node { tpdos: &[], ..node };
        assert_eq!(AxisPdos::of(&blind), None);
    }
}
