//! Errors of the drive: their codes, the bits of 1001h, the reaction, and the
//! history in 1003h (CiA 301, 7.5.2.4; EPOS4 Firmware Specification, errors).

/// Entries of 1003h.
pub const HISTORY: usize = 5;

/// What the drive does about an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// The power stage is switched off at once.
    Disable,
    /// As 605Eh says.
    FaultReaction,
    /// As 6007h says.
    AbortConnection,
    /// Bit 7 of the statusword, no change of state.
    Warning,
}

/// CAN overrun (8110h).
pub const CAN_OVERRUN: u16 = 0x8110;
/// CAN error passive (8120h).
pub const ERROR_PASSIVE: u16 = 0x8120;
/// Heartbeat or life guard error (8130h).
pub const HEARTBEAT: u16 = 0x8130;
/// A foreign frame on an own TPDO identifier (8150h).
pub const COB_ID_COLLISION: u16 = 0x8150;
/// Recovered from bus-off (81FDh).
pub const BUS_OFF: u16 = 0x81FD;
/// Receive queue overflow (81FEh).
pub const RECEIVE_QUEUE: u16 = 0x81FE;
/// Transmit queue overflow (81FFh).
pub const TRANSMIT_QUEUE: u16 = 0x81FF;
/// RPDO shorter than its mapping (8210h).
pub const PDO_LENGTH: u16 = 0x8210;

/// No set value has come in time (8250h).
pub const RPDO_TIMEOUT: u16 = 0x8250;
/// Following error (8611h).
pub const FOLLOWING: u16 = 0x8611;
/// Negative limit switch (8A80h).
pub const NEGATIVE_LIMIT: u16 = 0x8A80;
/// Positive limit switch (8A81h).
pub const POSITIVE_LIMIT: u16 = 0x8A81;
/// Software position limit (8A82h).
pub const SOFTWARE_LIMIT: u16 = 0x8A82;
/// Overload: a warning (FF01h).
pub const OVERLOAD: u16 = 0xFF01;
/// Safe torque off (8A88h).
pub const STO: u16 = 0x8A88;

/// First code, last code, bits of 1001h, reaction.
type Row = (u16, u16, u8, Reaction);

const TABLE: &[Row] = &[
    (0x1000, 0x1000, 0x01, Reaction::Disable),
    (0x1080, 0x1088, 0x01, Reaction::Disable),
    (0x1090, 0x1090, 0x01, Reaction::Disable),
    (0x2310, 0x2310, 0x02, Reaction::Disable),
    (0x2320, 0x2320, 0x02, Reaction::Disable),
    (0x3210, 0x3210, 0x04, Reaction::Disable),
    (0x3220, 0x3220, 0x04, Reaction::Disable),
    (0x4210, 0x4210, 0x08, Reaction::Disable),
    (0x4380, 0x4380, 0x08, Reaction::Disable),
    (0x5113, 0x5113, 0x04, Reaction::Disable),
    (0x5280, 0x5282, 0x01, Reaction::Disable),
    (0x5480, 0x5483, 0x01, Reaction::Disable),
    (0x6080, 0x6080, 0x01, Reaction::Disable),
    (0x6081, 0x6081, 0x01, Reaction::AbortConnection),
    (0x6180, 0x61F0, 0x01, Reaction::Disable),
    (0x6320, 0x6320, 0x01, Reaction::FaultReaction),
    (0x6380, 0x6380, 0x01, Reaction::Disable),
    (0x7320, 0x7320, 0x20, Reaction::Disable),
    (0x7380, 0x7382, 0x20, Reaction::Disable),
    (0x7388, 0x738A, 0x20, Reaction::Disable),
    (0x738C, 0x738D, 0x20, Reaction::Disable),
    (0x7390, 0x7392, 0x20, Reaction::Disable),
    (CAN_OVERRUN, 0x8111, 0x10, Reaction::AbortConnection),
    (
        ERROR_PASSIVE,
        ERROR_PASSIVE,
        0x10,
        Reaction::AbortConnection,
    ),
    (HEARTBEAT, HEARTBEAT, 0x10, Reaction::AbortConnection),
    (
        COB_ID_COLLISION,
        COB_ID_COLLISION,
        0x10,
        Reaction::AbortConnection,
    ),
    (BUS_OFF, TRANSMIT_QUEUE, 0x10, Reaction::AbortConnection),
    (PDO_LENGTH, PDO_LENGTH, 0x10, Reaction::AbortConnection),
    (RPDO_TIMEOUT, RPDO_TIMEOUT, 0x10, Reaction::AbortConnection),
    (FOLLOWING, FOLLOWING, 0x80, Reaction::FaultReaction),
    (
        NEGATIVE_LIMIT,
        SOFTWARE_LIMIT,
        0x80,
        Reaction::FaultReaction,
    ),
    (STO, STO, 0x01, Reaction::Disable),
    (OVERLOAD, OVERLOAD, 0x00, Reaction::Warning),
    (0xFF02, 0xFF02, 0x00, Reaction::Warning),
    (0xFF0B, 0xFF0B, 0x01, Reaction::Disable),
    (0xFF10, 0xFF10, 0x20, Reaction::FaultReaction),
    (0xFF11, 0xFF24, 0x20, Reaction::Disable),
];

/// The bits of 1001h and the reaction to `code`. A code that the drive's
/// manual does not list counts as generic and switches off.
pub fn classify(code: u16) -> (u8, Reaction) {
    TABLE
        .iter()
        .find(|(first, last, ..)| (*first..=*last).contains(&code))
        .map_or((0x01, Reaction::Disable), |row| (row.2, row.3))
}

/// The errors of one drive.
#[derive(Clone, Debug, Default)]
pub struct Errors {
    active: Vec<u16>,
    history: Vec<u16>,
    last: u16,
    /// The connection was lost: only a reset of the communication clears it.
    latched: bool,
    /// Causes that a fault reset cannot remove yet.
    persistent: Vec<u16>,
}

impl Errors {
    /// `code` occurs. False if it is active already: no second message then.
    pub fn raise(&mut self, code: u16) -> bool {
        if self.active.contains(&code) {
            return false;
        }
        self.active.push(code);
        self.history.insert(0, code);
        self.history.truncate(HISTORY);
        self.last = code;
        if matches!(code, HEARTBEAT | ERROR_PASSIVE) {
            self.latched = true;
        }
        true
    }

    /// As [`raise`](Errors::raise), with a cause that stays until
    /// [`cause_gone`](Errors::cause_gone).
    pub fn raise_lasting(&mut self, code: u16) -> bool {
        if !self.persistent.contains(&code) {
            self.persistent.push(code);
        }
        self.raise(code)
    }

    /// The cause of `code` is gone; the error itself waits for its reset.
    pub fn cause_gone(&mut self, code: u16) {
        self.persistent.retain(|&c| c != code);
    }

    /// The communication was reset.
    pub fn communication_reset(&mut self) {
        self.latched = false;
    }

    /// Whether a fault reset can succeed.
    pub fn may_reset(&self) -> bool {
        !self.latched && self.persistent.is_empty()
    }

    /// The fault reset: no error is active any more. False if none was.
    pub fn reset(&mut self) -> bool {
        let some = !self.active.is_empty();
        self.active.clear();
        some
    }

    /// 1001h.
    pub fn register(&self) -> u8 {
        self.active
            .iter()
            .fold(0, |bits, &code| bits | classify(code).0)
    }

    /// Whether `code` has occurred and was not reset.
    pub fn is_active(&self, code: u16) -> bool {
        self.active.contains(&code)
    }

    /// Whether a warning is active (bit 7 of the statusword).
    pub fn warning(&self) -> bool {
        self.active
            .iter()
            .any(|&code| classify(code).1 == Reaction::Warning)
    }

    /// 603Fh: the last error, also after its reset.
    pub fn last(&self) -> u16 {
        self.last
    }

    /// 1003h sub 0.
    pub fn count(&self) -> u8 {
        self.history.len() as u8
    }

    /// 1003h, newest first, from sub 1.
    pub fn entry(&self, sub: u8) -> Option<u16> {
        self.history.get(usize::from(sub).checked_sub(1)?).copied()
    }

    /// 0 was written to 1003h sub 0.
    pub fn clear_history(&mut self) {
        self.history.clear();
    }

    /// Clears a warning that has gone. False if it was not active.
    pub fn warning_gone(&mut self, code: u16) -> bool {
        let before = self.active.len();
        self.active.retain(|&c| c != code);
        self.active.len() != before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sorted_and_its_rows_do_not_overlap() {
        for pair in TABLE.windows(2) {
            assert!(pair[0].0 <= pair[0].1);
            assert!(pair[0].1 < pair[1].0);
        }
    }

    #[test]
    fn codes_of_the_manual() {
        assert_eq!(classify(0x2310), (0x02, Reaction::Disable));
        assert_eq!(classify(0x8130), (0x10, Reaction::AbortConnection));
        assert_eq!(classify(0x8611), (0x80, Reaction::FaultReaction));
        assert_eq!(classify(0xFF01), (0x00, Reaction::Warning));
        assert_eq!(classify(0x81FE), (0x10, Reaction::AbortConnection));
        assert_eq!(classify(0x4444), (0x01, Reaction::Disable));
    }

    #[test]
    fn the_history_is_newest_first_and_survives_a_reset() {
        let mut errors = Errors::default();
        for code in [0x2310, 0x3210, 0x4210, 0x5113, 0x6080, 0x8611] {
            assert!(errors.raise(code));
            assert!(!errors.raise(code), "told once");
        }
        assert_eq!(errors.register(), 0x02 | 0x04 | 0x08 | 0x01 | 0x80);
        assert!(errors.reset());
        assert_eq!(errors.register(), 0);
        assert_eq!(errors.count(), 5);
        assert_eq!(errors.entry(1), Some(0x8611));
        assert_eq!(errors.entry(5), Some(0x3210));
        assert_eq!(errors.entry(6), None);
        errors.clear_history();
        assert_eq!(errors.count(), 0);
        assert_eq!(errors.last(), 0x8611);
    }

    #[test]
    fn a_lost_heartbeat_waits_for_the_communication_reset() {
        let mut errors = Errors::default();
        errors.raise(HEARTBEAT);
        assert!(!errors.may_reset());
        errors.communication_reset();
        assert!(errors.may_reset());
    }

    #[test]
    fn a_lasting_cause_refuses_the_reset() {
        let mut errors = Errors::default();
        errors.raise_lasting(0x3220);
        assert!(!errors.may_reset());
        errors.cause_gone(0x3220);
        assert!(errors.may_reset());
    }
}
