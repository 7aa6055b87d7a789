//! Motion that the drive makes by itself: the set-point handshake of profile
//! position mode (CiA 402-2, 10.3) and homing (11.3).

use crate::cia402::StatusWord;
use crate::motion::mode::Mode;

/// Bit 4 of the controlword: new set-point, or begin homing.
const BEGIN: u16 = 1 << 4;
/// Bit 5: the set-point replaces the running one; else it comes after it.
const IMMEDIATELY: u16 = 1 << 5;
/// Bit 6: the set-point counts from the last one.
const RELATIVE: u16 = 1 << 6;

/// Fresh TPDOs until the statusword shows what came of a controlword: that of the
/// SYNC at which the drive takes it over was sampled before.
const SEEN_AFTER: u8 = 2;

/// How a set-point is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SetPoint {
    /// Where it ends, increments.
    pub target: i32,
    /// It replaces the running one at once; else the drive finishes that first.
    pub immediately: bool,
    /// The drive is told the way from the set-point before (bit 6).
    pub relative: bool,
    /// Cycles that it waits: it is handed over with the first set value of a path that
    /// begins so many steps later.
    pub after: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing is to be done.
    Done,
    /// To be asked of the drive as soon as it can take it.
    Asked,
    /// Bit 4 is set.
    Set,
    /// The drive took it; bit 4 is low again.
    Taken,
    /// The drive moves.
    Running,
}

/// What one axis has asked of its drive.
pub(super) struct DriveLed {
    phase: Phase,
    /// Fresh TPDOs since bit 4 was set.
    seen: u8,
    /// Cycles since it was to be asked, or since the drive took the set-point.
    waited: i32,
    /// Cycles in which homing has to end.
    limit: u32,
    /// 607Ah.
    pub(super) target: i32,
    flags: u16,
}

impl DriveLed {
    pub(super) const fn new() -> DriveLed {
        DriveLed {
            phase: Phase::Done,
            seen: 0,
            waited: 0,
            limit: 0,
            target: 0,
            flags: 0,
        }
    }

    /// Whether the drive took the last set-point: another may follow.
    pub(super) fn is_taken(&self) -> bool {
        matches!(self.phase, Phase::Done | Phase::Running)
    }

    /// A new set-point.
    pub(super) fn ask(&mut self, set_point: &SetPoint) {
        self.phase = Phase::Asked;
        self.waited = (set_point.after as i32).wrapping_neg();
        self.target = set_point.target;
        self.flags = if set_point.immediately {
            IMMEDIATELY
        } else {
            0
        } | if set_point.relative { RELATIVE } else { 0 };
    }

    /// Nothing is asked. If it `holds` a position, that replaces what the drive was told
    /// before, from the next controlword on: without it the drive goes on with that
    /// as soon as halt is over.
    pub(super) fn rest(&mut self, holds: Option<i32>) {
        self.ask(&SetPoint {
            target: holds.unwrap_or(0),
            immediately: true,
            ..SetPoint::default()
        });
        self.phase = match holds {
            Some(_) => Phase::Set,
            None => Phase::Done,
        };
    }

    /// What was asked is halted: none of it counts any more.
    pub(super) fn stop(&mut self) {
        self.phase = Phase::Done;
    }

    /// The position that the drive was told to hold, until it was told something else.
    pub(super) fn held(&self) -> Option<i32> {
        (self.phase == Phase::Set).then_some(self.target)
    }

    /// Homing, to end within `limit` cycles.
    pub(super) fn home(&mut self, limit: u32) {
        self.ask(&SetPoint::default());
        self.limit = limit;
    }

    /// Bits 4 to 6 of the controlword, and the target that belongs to them.
    pub(super) fn begun(&self) -> Option<(u16, i32)> {
        (self.phase == Phase::Set).then_some((BEGIN | self.flags, self.target))
    }

    /// Takes in a statusword, if a fresh one came, `passed` cycles later. `false`: it reports that homing
    /// failed.
    pub(super) fn hear(&mut self, mode: Mode, status: Option<StatusWord>, passed: u32) -> bool {
        // What waits for ever is not judged by it.
        self.waited = self.waited.wrapping_add(passed as i32);
        let Some(status) = status else {
            return true;
        };
        let (flag, reached) = (status.mode_bit_12(), status.target_reached());
        let homing = mode != Mode::ProfilePosition;
        match self.phase {
            Phase::Asked if self.waited > 0 && (homing || !flag) => {
                self.phase = Phase::Set;
                self.seen = 0;
            }
            Phase::Set if !homing && flag => self.phase = Phase::Taken,
            Phase::Set if !homing => {}
            Phase::Set if self.seen < SEEN_AFTER => self.seen += 1,
            Phase::Set if status.mode_bit_13() => return false,
            Phase::Set if flag && reached => self.phase = Phase::Done,
            Phase::Taken if !flag => {
                self.waited = 0;
                self.phase = Phase::Running;
            }
            Phase::Running if !flag && reached => self.phase = Phase::Done,
            _ => {}
        }
        true
    }

    /// Whether it is done.
    pub(super) fn is_done(&self) -> bool {
        self.phase == Phase::Done
    }

    /// Whether a handshake takes more than `limit` cycles, or homing longer than it
    /// may.
    pub(super) fn is_late(&self, mode: Mode, limit: u32) -> bool {
        let limit = match (mode, self.phase) {
            (Mode::Homing, _) => self.limit,
            // The drive moves as long as it needs.
            (_, Phase::Running) => i32::MAX as u32,
            _ => limit,
        };
        self.waited > limit as i32
    }
}
