//! What waits to be sent on each bus, and when it may be.
//!
//! A cycle is laid out (`network.toml`): SYNC, the TPDOs, the burst of RPDOs, and
//! a number of planned frames, which is everything else that the master sends. The
//! planned ones have a window after the SYNC; an SDO request has one of its own,
//! so that its answer comes where there is room for it. Before the end of the
//! cycle nothing is begun that could still be on the wire when the next SYNC is
//! due. While no SYNC is produced all may go at any time.

use crate::measured;
use crate::{
    counters::Count,
    derived::{
        self, AXES, AXIS_BUSES, BUSES, CONTROLLERS, EARLY, FRAME_US, GUARD_US, NETWORK,
        ONE_PLANNED, SDO_NEXT_CYCLE,
    },
};
use canmaster::{
    Frame,
    id::{CobId, FunctionCode},
    master::{Burst, Pending, Put, TPDOS_PER_AXIS, TxQueue, holds, room},
    sync::SyncCounter,
};
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering::Relaxed};
use nucleo_g474re::{can, pac::Interrupt, timers::Phase};
use rtic::Mutex;

/// 1005h, bit 30: the master produces SYNC.
pub(crate) static PRODUCING: AtomicBool = AtomicBool::new(false);
/// SYNCs since the start.
pub(crate) static SYNCS: AtomicU32 = AtomicU32::new(0);
/// The bus on which a client spoke to the board last.
static CLIENT: AtomicU8 = AtomicU8::new(0);

/// What sends, with the frame that `sync_tick` sends.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
pub struct Sender {
    pub(crate) tx: can::Tx,
    pub(crate) sync: can::Element,
    /// 1019h.
    pub(crate) counter: SyncCounter,
}

impl Sender {
    /// Requests the SYNC on every bus.
    #[inline(always)]
    pub(crate) fn sync(&mut self) {
        self.sync.set_byte(self.counter.count());
        // Not in a loop, so that the addresses are constant.
        self.sync_on(CONTROLLERS.first());
        self.sync_on(CONTROLLERS.get(1));
        self.sync_on(CONTROLLERS.get(2));
    }

    #[inline(always)]
    fn sync_on(&mut self, controller: Option<&can::Controller>) {
        let Some(&controller) = controller else {
            return;
        };
        let pending = can::pending(controller, can::waiting(controller));
        let waits = holds(&pending, CobId::SYNC);
        let Some(buffers) = can::Buffers::of(controller) else {
            return;
        };
        if waits || self.tx.transmit(buffers, &self.sync) == can::BUFFERS {
            Count::SyncNotSent.add(1);
        }
    }
}

const EARLY_FRAMES: usize = if EARLY { TPDOS_PER_AXIS * AXES } else { 1 };

/// What waits to be sent on one bus.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
pub struct Line {
    /// RPDOs of every cycle that go after the TPDOs of their own cycle.
    burst: Burst<{ TPDOS_PER_AXIS * AXES }>,
    /// RPDOs of every cycle that wait for the next SYNC.
    early: [Burst<EARLY_FRAMES>; 2],
    /// Which of the two is being sent; the other is made meanwhile.
    second: bool,
    /// The SYNC after whose TPDOs they were made.
    made_after: u32,
    /// RPDOs were dropped since [`begin`](Line::begin) was called.
    late: bool,
    /// Everything else.
    pub(crate) planned: TxQueue<{ derived::TX_QUEUE }>,
    /// The cycle that `left` is for.
    cycle: u32,
    /// How many planned frames may still go in it.
    left: u8,
}

/// All buses, where they stay.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
pub type Lines = &'static mut [Line; BUSES];

impl Line {
    pub(crate) const fn new() -> Line {
        Line {
            burst: Burst::new(),
            early: [const { Burst::new() }; 2],
            second: false,
            made_after: 0,
            late: false,
            planned: TxQueue::new(),
            cycle: 0,
            left: 0,
        }
    }

    /// Takes the RPDOs of another cycle. Whether some of those before were not sent;
    /// these are counted.
    pub(crate) fn begin(&mut self, sync: u32) -> bool {
        let left = self.burst.begin();
        self.drop_late(left);
        if EARLY {
            self.early(false).begin();
        }
        self.made_after = sync;
        core::mem::take(&mut self.late)
    }

    fn drop_late(&mut self, left: usize) {
        if left != 0 {
            Count::RpdoReplaced.add(left as u32);
            self.late = true;
        }
    }

    /// An RPDO of every cycle, to be sent in its own or after the next SYNC.
    pub(crate) fn cyclic(&mut self, frame: Frame, early: bool) {
        if EARLY && early {
            self.early(false).put(frame);
        } else {
            self.burst.put(frame);
        }
    }

    /// An RPDO on change.
    pub(crate) fn on_change(&mut self, frame: Frame) {
        if let Ok(Put::Replaced) = self.planned.put_latest(frame) {
            Count::RpdoReplaced.add(1);
        }
    }

    /// Drops all, after bus-off.
    pub(crate) fn clear(&mut self) {
        self.burst.begin();
        for burst in &mut self.early {
            burst.begin();
        }
        self.planned.clear();
    }

    /// What is to be given to the controller next.
    #[inline(always)]
    fn next(&mut self, bus: usize, pending: &Pending, phase: Phase) -> Option<Frame> {
        let waits = !self.planned.is_empty();
        if !waits && !self.rpdos_wait() {
            return None;
        }
        let producing = PRODUCING.load(Relaxed);
        if producing && phase.left_us() < GUARD_US + FRAME_US {
            return None;
        }
        let syncs = SYNCS.load(Relaxed);
        if EARLY {
            if (!producing || self.made_after != syncs) && !self.early(false).is_over() {
                let left = self.early(true).begin();
                self.drop_late(left);
                self.second = !self.second;
            }
            // Before the planned frames, which would take a buffer from them for long.
            if !self.early(true).is_over() {
                return self.early(true).next(pending).copied();
            }
        }
        if waits && let Some(frame) = self.next_planned(bus, pending, producing, phase) {
            return Some(frame);
        }
        if producing && self.made_after != syncs {
            // Made too late for its own cycle, nothing is sent in the next.
            let left = self.burst.begin();
            self.drop_late(left);
            return None;
        }
        self.burst.next(pending).copied()
    }

    #[inline(always)]
    fn rpdos_wait(&self) -> bool {
        let [first, second] = &self.early;
        !self.burst.is_over() || EARLY && !(first.is_over() && second.is_over())
    }

    /// The burst that is being sent, or the one that is made meanwhile.
    #[inline(always)]
    fn early(&mut self, being_sent: bool) -> &mut Burst<EARLY_FRAMES> {
        let [first, second] = &mut self.early;
        match self.second == being_sent {
            true => second,
            false => first,
        }
    }

    #[inline(always)]
    fn rpdos_are_sent(&mut self) -> bool {
        self.burst.is_over() && (!EARLY || self.early(true).is_over())
    }

    #[inline(never)]
    fn next_planned(
        &mut self,
        bus: usize,
        pending: &Pending,
        producing: bool,
        phase: Phase,
    ) -> Option<Frame> {
        let syncs = SYNCS.load(Relaxed);
        if syncs.wrapping_sub(self.cycle).cast_signed() > 0 {
            self.cycle = syncs;
            self.left = match ONE_PLANNED.get(bus) {
                Some(true) => 1,
                _ => u8::MAX,
            };
        }
        let left = if producing { self.left } else { u8::MAX };
        if left == 0 {
            return None;
        }
        let us = phase.elapsed_us() as u16;
        let free = left > 1;
        let (from, until) = *derived::SDO_US.get(bus)?;
        let sdo = free || (from <= us && us < until && self.rpdos_are_sent());
        let until = match EARLY {
            // Whenever the RPDOs are sent: TPDOs may have gone ahead of these.
            true => u16::MAX,
            false => *derived::AFTER_SYNC_US.get(bus)?,
        };
        let others = free || us < until;
        let may = |id| if is_sdo(id) { sdo } else { others };
        let next = self.planned.next_of(pending, may);
        if let Some(frame) = &next
            && !free
        {
            self.left = 0;
            let answered_later = SDO_NEXT_CYCLE.get(bus).is_some_and(|later| *later);
            if answered_later && is_sdo(frame.id()) {
                self.cycle = syncs.wrapping_add(1);
            }
        }
        next
    }
}

/// Whether RPDOs that were made just now, after a SYNC, can be sent as they are to be.
pub(crate) fn in_time(sync: u32, phase: Phase) -> bool {
    let wait = derived::RPDOS_AFTER_SYNC;
    sync == SYNCS.load(Relaxed) && (wait || phase.left_us() >= GUARD_US + FRAME_US)
}

fn is_sdo(id: CobId) -> bool {
    let function = id.split().map(|(function, _)| function);
    matches!(
        function,
        Some(FunctionCode::SdoRequest | FunctionCode::SdoResponse)
    )
}

/// Requests a frame under the ceiling of the SYNC. A function of its own, so that
/// all registers are free for what happens meanwhile.
#[inline(never)]
fn request(
    sender: &mut impl Mutex<T = Sender>,
    buffers: can::Buffers,
    element: can::Element,
) -> usize {
    let (element, to) = (element.made(), buffers.made());
    sender.lock(|sender| sender.tx.transmit(to, &element))
}

/// Gives the controller of a bus what it has room for.
#[inline(always)]
pub(crate) fn refill(
    bus: usize,
    lines: &mut impl Mutex<T = Lines>,
    sender: &mut impl Mutex<T = Sender>,
    phase: Phase,
) {
    let Some((&controller, buffers)) = CONTROLLERS
        .get(bus)
        .and_then(|controller| Some((controller, can::Buffers::of(*controller)?)))
    else {
        return;
    };
    let waiting = can::waiting(controller);
    let room = room(waiting);
    if room == 0 {
        return;
    }
    // Its ceiling is the priority of the task that does this.
    lines.lock(|lines| {
        let Some(line) = lines.get_mut(bus) else {
            return;
        };
        let mut pending = can::pending(controller, waiting);
        for _ in 0..room {
            let Some(frame) = line.next(bus, &pending, phase) else {
                break;
            };
            let sent = request(sender, buffers, element(&frame));
            if let Some(place) = pending.get_mut(sent) {
                *place = frame.id().get();
            } else {
                // Two frames at most were there, and a SYNC: it cannot come to this.
                Count::RpdoReplaced.add(1);
            }
            measured::add_bits(bus, frame.dlc().into());
        }
    });
}

/// The frame as the controller wants it.
#[inline(always)]
pub(crate) fn element(frame: &Frame) -> can::Element {
    let id = frame.id().into();
    can::Element::new(id, frame.is_remote(), frame.dlc(), frame.padded())
}

/// There may be something to send on a bus.
static WANTED: [AtomicBool; BUSES] = [const { AtomicBool::new(false) }; BUSES];

/// Has the controllers look for something to send.
#[inline(always)]
pub(crate) fn send_now() {
    for (wanted, interrupt) in WANTED.iter().zip(INTERRUPTS) {
        wanted.store(true, Relaxed);
        rtic::pend(interrupt);
    }
}

/// Whether that was asked for since the last call.
#[inline(always)]
pub(crate) fn take_wanted(bus: usize) -> bool {
    let Some(wanted) = WANTED.get(bus) else {
        return false;
    };
    let asked = wanted.load(Relaxed);
    if asked {
        // Who asks now is served by what follows.
        wanted.store(false, Relaxed);
    }
    asked
}

/// Of each bus.
const INTERRUPTS: [Interrupt; BUSES] = {
    let mut all = [Interrupt::FDCAN1_IT0; BUSES];
    let mut bus = 0;
    while bus < BUSES {
        all[bus] = match derived::BUS_PERIPHERALS[bus] {
            2 => Interrupt::FDCAN2_IT0,
            3 => Interrupt::FDCAN3_IT0,
            _ => Interrupt::FDCAN1_IT0,
        };
        bus += 1;
    }
    all
};

/// The bus on which a frame is sent; `None`: all.
fn bus_of(id: CobId) -> Option<usize> {
    if BUSES == 1 {
        return None;
    }
    let (_, node) = id.split()?;
    if node == NETWORK.master.node {
        // Its heartbeat and its emergencies are for everybody.
        let answer = id == CobId::of(FunctionCode::SdoResponse, node);
        return answer.then(|| CLIENT.load(Relaxed).into());
    }
    let (axis, _) = NETWORK.find(node)?;
    AXIS_BUSES.get(axis).map(|bus| usize::from(*bus))
}

/// A client on this bus has spoken to the board.
#[inline(always)]
pub(crate) fn client_on(bus: usize) {
    if BUSES > 1 {
        CLIENT.store(bus as u8, Relaxed);
    }
}

/// Queues a planned frame on its bus, or on all, and has it sent. A full queue
/// counts it. `limit`: only where fewer wait. Whether it was queued.
pub(crate) fn send(lines: &mut impl Mutex<T = Lines>, frame: Frame, limit: usize) -> bool {
    let to = bus_of(frame.id());
    let sent = lines.lock(|lines| {
        let mut sent = false;
        for (bus, line) in lines.iter_mut().enumerate() {
            if to.is_none_or(|to| to == bus) && line.planned.len() < limit {
                sent |= line.planned.put(frame).is_ok();
            }
        }
        sent
    });
    send_now();
    sent
}

/// Whether fewer than `limit` frames wait on every bus.
pub(crate) fn have_room(lines: &mut impl Mutex<T = Lines>, limit: usize) -> bool {
    lines.lock(|lines| lines.iter().all(|line| line.planned.len() < limit))
}
