//! The PDOs of an axis as this master exchanges them: in which RPDO the target of
//! each mode lies, and where in TPDO1 and TPDO2 what is reported, follows from the
//! network's mapping.
//!
//! | direction | objects |
//! |---|---|
//! | to the drive, one of them per cycle | controlword 6040h and target velocity 60FFh, target position 607Ah or target torque 6071h |
//! | to the drive, on change or per cycle | profile acceleration 6083h, profile deceleration 6084h |
//! | from the drive | statusword 6041h, position 6064h; velocity 606Ch and torque 6077h may be left out |

use super::od::{IMAGE_BYTES, TPDOS_PER_AXIS};
use crate::frame::{Frame, MAX_DATA};
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::motion::mode::Mode;
use crate::motion::{AxisCommand, AxisFeedback};
use crate::network::{Network, Node, Pdo};
use crate::objects;
use crate::pdo::MappingEntry;

const fn entry(at: Address, bits: u8) -> MappingEntry {
    MappingEntry::new(at.index.0, at.sub.0, bits)
}

const CONTROLWORD: MappingEntry = entry(objects::CONTROLWORD, 16);
const TARGET_VELOCITY: MappingEntry = entry(objects::TARGET_VELOCITY, 32);
const TARGET_POSITION: MappingEntry = entry(objects::TARGET_POSITION, 32);
const TARGET_TORQUE: MappingEntry = entry(objects::TARGET_TORQUE, 16);
const ACCELERATION: MappingEntry = entry(objects::PROFILE_ACCELERATION, 32);
const DECELERATION: MappingEntry = entry(objects::PROFILE_DECELERATION, 32);
const STATUSWORD: MappingEntry = entry(objects::STATUSWORD, 16);
const POSITION: MappingEntry = entry(objects::POSITION_ACTUAL, 32);
const VELOCITY: MappingEntry = entry(objects::VELOCITY_ACTUAL, 32);
const TORQUE: MappingEntry = entry(objects::TORQUE_ACTUAL, 16);

/// The byte at which an object begins in the mapping of a PDO.
const fn offset(pdo: &Pdo, wanted: MappingEntry) -> Option<u8> {
    let (mut entries, mut bit) = (pdo.mapping, 0);
    while let Some((mapped, more)) = entries.split_first() {
        if mapped.0 == wanted.0 {
            return Some(bit / u8::BITS as u8);
        }
        bit += mapped.bits();
        entries = more;
    }
    None
}

/// Whole bytes of a PDO.
const fn length(pdo: &Pdo) -> u8 {
    let (mut entries, mut bits) = (pdo.mapping, 0);
    while let Some((mapped, more)) = entries.split_first() {
        bits += mapped.bits();
        entries = more;
    }
    bits / u8::BITS as u8
}

/// Where a reported object lies: from which byte of the TPDOs on, put one behind
/// the other with eight each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place(u8);

/// An object that is not mapped lies behind all that is.
const NOWHERE: Place = Place((MAX_DATA * TPDOS_PER_AXIS) as u8);

impl Place {
    /// The first place of `wanted` in these PDOs; `None`: not mapped.
    const fn find(pdos: &[Pdo], wanted: MappingEntry) -> Option<Place> {
        let mut left = pdos;
        while let Some((pdo, others)) = left.split_first() {
            if let Some(offset) = offset(pdo, wanted)
                && pdo.number as usize <= TPDOS_PER_AXIS
            {
                let first = pdo.number.saturating_sub(1) * MAX_DATA as u8;
                return Some(Place(first + offset));
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

    /// The object and what follows it; 0 if it is not mapped.
    #[inline]
    fn read(self, image: &[u8; IMAGE_BYTES]) -> u32 {
        let bytes = image
            .get(usize::from(self.0)..)
            .and_then(<[u8]>::first_chunk);
        bytes.map_or(0, |bytes| u32::from_le_bytes(*bytes))
    }
}

/// Bytes of an RPDO while it is made: those that an object of 16 bits at its end is
/// written into are cut off.
type Made = [u8; MAX_DATA + 4];

/// An RPDO with two objects that the master writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Rpdo {
    /// 1 ..= 4.
    number: u8,
    function: FunctionCode,
    bytes: u8,
    /// Where the two begin.
    first: u8,
    second: u8,
}

impl Rpdo {
    /// The first RPDO that carries both.
    const fn find(pdos: &[Pdo], first: MappingEntry, second: MappingEntry) -> Option<Rpdo> {
        let mut left = pdos;
        while let Some((pdo, others)) = left.split_first() {
            if let (Some(first), Some(second)) = (offset(pdo, first), offset(pdo, second)) {
                return Some(Rpdo {
                    number: pdo.number,
                    function: match pdo.number {
                        1 => FunctionCode::Rpdo1,
                        2 => FunctionCode::Rpdo2,
                        3 => FunctionCode::Rpdo3,
                        _ => FunctionCode::Rpdo4,
                    },
                    bytes: length(pdo),
                    first,
                    second,
                });
            }
            left = others;
        }
        None
    }

    /// The second object, and over what follows it the first.
    #[inline]
    fn data<const BYTES: usize>(&self, first: [u8; BYTES], second: u32) -> [u8; MAX_DATA] {
        let mut made: Made = [0; MAX_DATA + 4];
        if let Some(place) = made.get_mut(usize::from(self.second)..)
            && let Some(place) = place.first_chunk_mut()
        {
            *place = second.to_le_bytes();
        }
        if let Some(place) = made.get_mut(usize::from(self.first)..)
            && let Some(place) = place.first_chunk_mut()
        {
            *place = first;
        }
        let [a, b, c, d, e, f, g, h, ..] = made;
        [a, b, c, d, e, f, g, h]
    }

    fn frame(&self, node: NodeId, data: [u8; MAX_DATA]) -> Frame {
        Frame::of_padded(CobId::of(self.function, node), self.bytes, data)
    }
}

/// Targets that the modes of operation have.
const TARGETS: usize = 3;

/// Which of them a mode has; homing has that of velocity, at 0.
const fn target_of(mode: Mode) -> usize {
    match mode {
        Mode::ProfileVelocity | Mode::CyclicVelocity | Mode::Homing => 0,
        Mode::ProfilePosition | Mode::CyclicPosition => 1,
        Mode::CyclicTorque => 2,
    }
}

/// The PDOs of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisPdos {
    /// Controlword and target, by [`target_of`] the mode.
    targets: [Option<Rpdo>; TARGETS],
    /// Profile acceleration and deceleration.
    ramps: Option<Rpdo>,
    /// In the order of [`AxisFeedback`].
    feedback: [Place; 4],
    tpdo_bytes: [u8; TPDOS_PER_AXIS],
}

/// Whole bytes of the TPDOs; 0 where there is none.
const fn lengths(pdos: &[Pdo]) -> [u8; TPDOS_PER_AXIS] {
    let mut bytes = [0; TPDOS_PER_AXIS];
    let mut left = pdos;
    while let Some((pdo, others)) = left.split_first() {
        let [first, second] = &mut bytes;
        match pdo.number {
            1 => *first = length(pdo),
            2 => *second = length(pdo),
            _ => {}
        }
        left = others;
    }
    bytes
}

impl AxisPdos {
    /// Nothing is exchanged.
    const NONE: AxisPdos = AxisPdos {
        targets: [None; TARGETS],
        ramps: None,
        feedback: [NOWHERE; 4],
        tpdo_bytes: [0; TPDOS_PER_AXIS],
    };

    /// The PDOs as `node` has them mapped. `None` if an object is missing that an
    /// axis cannot be led without in profile velocity mode, in which it starts.
    pub const fn of(node: &Node) -> Option<AxisPdos> {
        let kind = node.kind;
        let (Some(velocity), Some(ramps), Some(statusword), Some(position)) = (
            Rpdo::find(kind.rpdos, CONTROLWORD, TARGET_VELOCITY),
            Rpdo::find(kind.rpdos, ACCELERATION, DECELERATION),
            Place::find(kind.tpdos, STATUSWORD),
            Place::find(kind.tpdos, POSITION),
        ) else {
            return None;
        };
        Some(AxisPdos {
            targets: [
                Some(velocity),
                Rpdo::find(kind.rpdos, CONTROLWORD, TARGET_POSITION),
                Rpdo::find(kind.rpdos, CONTROLWORD, TARGET_TORQUE),
            ],
            ramps: Some(ramps),
            feedback: [
                statusword,
                position,
                Place::find_or_nowhere(kind.tpdos, VELOCITY),
                Place::find_or_nowhere(kind.tpdos, TORQUE),
            ],
            tpdo_bytes: lengths(kind.tpdos),
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

    /// Whether an RPDO carries the target of a mode.
    pub fn has_mode(&self, mode: Mode) -> bool {
        self.target(mode).is_some()
    }

    #[inline]
    fn target(&self, mode: Mode) -> Option<&Rpdo> {
        self.targets.get(target_of(mode))?.as_ref()
    }

    /// What the TPDOs of the axis say. `fresh`: all came with this SYNC.
    pub fn feedback(&self, image: &[u8; IMAGE_BYTES], fresh: bool) -> AxisFeedback {
        let [statusword, position, velocity, torque] = self.feedback;
        AxisFeedback {
            statusword: statusword.read(image) as u16,
            position: position.read(image) as i32,
            velocity: velocity.read(image) as i32,
            torque: torque.read(image) as i16,
            fresh,
        }
    }

    /// The RPDO of every cycle for `node`: that of the mode of `command`. `None`: it
    /// is not mapped.
    #[inline]
    pub fn cyclic(&self, command: &AxisCommand, node: NodeId) -> Option<Frame> {
        let rpdo = self.target(command.mode)?;
        Some(rpdo.frame(node, Self::target_data(rpdo, command)))
    }

    fn target_data(rpdo: &Rpdo, command: &AxisCommand) -> [u8; MAX_DATA] {
        rpdo.data(command.controlword.to_le_bytes(), command.target as u32)
    }

    /// The RPDO with the ramps of `command` for `node`.
    #[inline]
    pub fn ramps(&self, command: &AxisCommand, node: NodeId) -> Option<Frame> {
        let rpdo = self.ramps.as_ref()?;
        Some(rpdo.frame(node, Self::ramps_data(rpdo, command)))
    }

    fn ramps_data(rpdo: &Rpdo, command: &AxisCommand) -> [u8; MAX_DATA] {
        rpdo.data(command.acceleration.to_le_bytes(), command.deceleration)
    }

    /// The bytes of the RPDO `number`, counted from 1, as `command` has it sent;
    /// zeros of one that it has not.
    pub fn rpdo(&self, number: u8, command: &AxisCommand) -> [u8; MAX_DATA] {
        let is = |rpdo: &&Rpdo| rpdo.number == number;
        if let Some(rpdo) = self.target(command.mode).filter(is) {
            return Self::target_data(rpdo, command);
        }
        match self.ramps.as_ref().filter(is) {
            Some(rpdo) => Self::ramps_data(rpdo, command),
            None => [0; MAX_DATA],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::Kind;
    use crate::network::sample::SIX_EPOS4_10_MS as SIX_EPOS4;
    use std::boxed::Box;

    const PDOS: usize = TPDOS_PER_AXIS;

    fn pdos() -> [AxisPdos; 6] {
        AxisPdos::of_all(&SIX_EPOS4).unwrap()
    }

    fn image(tpdos: [[u8; MAX_DATA]; PDOS]) -> [u8; IMAGE_BYTES] {
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
        let [pdos, ..] = pdos();
        assert!(Mode::ALL.into_iter().all(|mode| pdos.has_mode(mode)));
    }

    const COMMAND: AxisCommand = AxisCommand {
        mode: Mode::ProfileVelocity,
        controlword: 0x000F,
        target: -1200,
        acceleration: 1500,
        deceleration: 0x0102_0304,
    };

    const fn in_mode(mode: Mode) -> AxisCommand {
        AxisCommand { mode, ..COMMAND }
    }

    /// The four RPDOs are mapped once; per cycle the one of the active mode is sent.
    #[test]
    fn golden_bytes_of_every_mode() {
        let [pdos, ..] = pdos();
        let node = NodeId::constant::<3>();
        let target = [0x0F, 0x00, 0x50, 0xFB, 0xFF, 0xFF];
        for (mode, id, bytes) in [
            (Mode::ProfileVelocity, 0x203, 6),
            (Mode::CyclicVelocity, 0x203, 6),
            (Mode::Homing, 0x203, 6),
            (Mode::ProfilePosition, 0x403, 6),
            (Mode::CyclicPosition, 0x403, 6),
            (Mode::CyclicTorque, 0x503, 4),
        ] {
            let frame = pdos.cyclic(&in_mode(mode), node).unwrap();
            assert_eq!(frame.id().get(), id, "{mode:?}");
            assert_eq!(frame.data(), &target[..bytes], "{mode:?}");
        }
        let frame = pdos.ramps(&COMMAND, node).unwrap();
        assert_eq!(frame.id().get(), 0x303);
        assert_eq!(frame.data(), [0xDC, 0x05, 0, 0, 4, 3, 2, 1]);
    }

    #[test]
    fn golden_bytes_by_number() {
        let [pdos, ..] = pdos();
        let command = in_mode(Mode::CyclicPosition);
        assert_eq!(pdos.rpdo(1, &command), [0; MAX_DATA]);
        let ramps = [0xDC, 0x05, 0, 0, 4, 3, 2, 1];
        assert_eq!(pdos.rpdo(2, &command), ramps);
        let target = [0x0F, 0x00, 0x50, 0xFB, 0xFF, 0xFF, 0, 0];
        assert_eq!(pdos.rpdo(3, &command), target);
        assert_eq!(pdos.rpdo(4, &command), [0; MAX_DATA]);
    }

    #[test]
    fn golden_bytes_of_the_feedback() {
        let [pdos, ..] = pdos();
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

    const fn pdo(number: u8, mapping: &'static [MappingEntry]) -> Pdo {
        Pdo {
            number,
            transmission: crate::pdo::Transmission::Synchronous(1),
            mapping,
        }
    }

    /// Another order, another division, a gap, and no torque.
    #[test]
    fn another_mapping() {
        const OTHER: MappingEntry = MappingEntry::new(0x6061, 0, 8);
        const RPDOS: &[Pdo] = &[
            pdo(4, &[TARGET_VELOCITY, CONTROLWORD]),
            pdo(1, &[DECELERATION, ACCELERATION]),
            pdo(2, &[TARGET_TORQUE, CONTROLWORD]),
        ];
        const TPDOS: &[Pdo] = &[
            pdo(1, &[OTHER, VELOCITY]),
            pdo(2, &[POSITION, OTHER, STATUSWORD]),
        ];
        let id = NodeId::constant::<7>();
        let with = |rpdos, tpdos| {
            let node = crate::network::sample::epos4(id, "axis 7");
            let kind = Box::leak(Box::new(Kind {
                rpdos,
                tpdos,
                ..*node.kind
            }));
            AxisPdos::of(&Node { kind, ..node })
        };
        let pdos = with(RPDOS, TPDOS).unwrap();
        let frame = pdos.ramps(&COMMAND, id).unwrap();
        assert_eq!(frame.id().get(), 0x207);
        assert_eq!(frame.data(), [4, 3, 2, 1, 0xDC, 0x05, 0, 0]);
        let frame = pdos.cyclic(&COMMAND, id).unwrap();
        assert_eq!(frame.id().get(), 0x507);
        assert_eq!(frame.data(), [0x50, 0xFB, 0xFF, 0xFF, 0x0F, 0x00]);
        // The upper half of the target is under the controlword.
        let torque = pdos.cyclic(&in_mode(Mode::CyclicTorque), id).unwrap();
        assert_eq!(torque.data(), [0x50, 0xFB, 0x0F, 0x00]);
        assert!(!pdos.has_mode(Mode::CyclicPosition));
        assert_eq!(pdos.cyclic(&in_mode(Mode::CyclicPosition), id), None);
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
        let slow = with(RPDOS, NO_VELOCITY).unwrap();
        assert!(!slow.has_velocity());
        assert_eq!(AxisPdos::tpdo_bytes(&[slow]), [[6, 0]]);
        assert_eq!(slow.feedback(&tpdos, true).velocity, 0);

        assert_eq!(with(RPDOS, &[]), None);
        const APART: &[Pdo] = &[
            pdo(1, &[CONTROLWORD, ACCELERATION]),
            pdo(2, &[TARGET_VELOCITY, DECELERATION]),
        ];
        assert_eq!(with(APART, TPDOS), None);
    }
}
