//! SDO requests that stand alone, besides the boot-up's: a node's heartbeat is
//! switched off when it is operational, if `network.toml` says so; and where it
//! wants that, the nodes of each bus are asked for their error register in turn.
//! Answers need nothing done.

use crate::{
    counters::Count,
    derived::{AXES, AXIS_BUSES, BUSES, HEARTBEATS_IN_OPERATIONAL, NETWORK, SDO_EVERY},
    lines::{self, Lines, SYNCS},
};
use canmaster::{
    Frame, NodeId, design,
    id::{Address, CobId, FunctionCode},
    objects,
};
use core::sync::atomic::Ordering::Relaxed;
use rtic::Mutex;

/// Download initiate, expedited, two bytes (CiA 301, 7.2.4.3.3).
const DOWNLOAD_U16: u8 = 0x2B;
/// Upload initiate (CiA 301, 7.2.4.3.6).
const UPLOAD: u8 = 0x40;

/// Whether any node is asked.
const ASKS: bool = {
    let (mut asks, mut bus) = (false, 0);
    while bus < BUSES {
        asks |= SDO_EVERY[bus] != 0;
        bus += 1;
    }
    asks
};

/// A request of one frame, with a value of up to four bytes.
pub(crate) fn request(command: u8, at: Address, node: NodeId, value: u32) -> Frame {
    let [low, high] = at.index.0.to_le_bytes();
    let [a, b, c, d] = value.to_le_bytes();
    Frame::full(
        CobId::of(FunctionCode::SdoRequest, node),
        [command, low, high, at.sub.0, a, b, c, d],
    )
}

/// Whether the heartbeat of an axis is watched: else it is off in operational, and
/// its TPDOs say that it is alive.
pub(crate) fn is_watched(axis: usize) -> bool {
    HEARTBEATS_IN_OPERATIONAL.get(axis).is_none_or(|on| *on)
}

/// Switches the heartbeat of a node off that has come into operational, if it is
/// not to have one there.
pub(crate) fn quieten(node: NodeId) -> Option<Frame> {
    let (axis, _) = NETWORK.find(node)?;
    let frame = request(DOWNLOAD_U16, objects::PRODUCER_HEARTBEAT, node, 0);
    (!is_watched(axis)).then_some(frame)
}

/// Whose turn it is on each bus, and since when.
#[derive(Default)]
pub(crate) struct Asking {
    last: [u32; BUSES],
    turn: [u8; BUSES],
}

impl Asking {
    /// Asks the next of the `operational` nodes of each bus whose time has come.
    #[inline(always)]
    pub(crate) fn go_on(&mut self, operational: u32, lines: &mut impl Mutex<T = Lines>) {
        if ASKS {
            self.ask(operational, lines);
        }
    }

    fn ask(&mut self, operational: u32, lines: &mut impl Mutex<T = Lines>) {
        let syncs = SYNCS.load(Relaxed);
        let buses = self.last.iter_mut().zip(&mut self.turn).zip(SDO_EVERY);
        for (bus, ((last, turn), every)) in buses.enumerate() {
            if every == 0 || syncs.wrapping_sub(*last) < u32::from(every) {
                continue;
            }
            for _ in 0..AXES {
                *turn = (*turn + 1) % AXES as u8;
                let axis = usize::from(*turn);
                let here = AXIS_BUSES
                    .get(axis)
                    .is_some_and(|on| usize::from(*on) == bus);
                if here
                    && operational & 1 << axis != 0
                    && let Some(node) = NETWORK.nodes.get(axis)
                {
                    let frame = request(UPLOAD, objects::ERROR_REGISTER, node.id, 0);
                    // Behind the board's own answers; the last request has gone.
                    if lines::send(lines, frame, design::OWN_FRAMES + 1) {
                        *last = syncs;
                    }
                    break;
                }
            }
        }
    }
}

/// Whether `frame` answers such a question: nobody else asks for that object. It
/// is counted.
#[inline(always)]
pub(crate) fn is_answer(frame: &Frame) -> bool {
    if !ASKS {
        return false;
    }
    let [_, low, high, sub, ..] = frame.padded();
    let at = objects::ERROR_REGISTER;
    let answer = [low, high] == at.index.0.to_le_bytes() && sub == at.sub.0;
    if answer {
        Count::Answers.add(1);
    }
    answer
}
