//! What a controller does when something went wrong, and between frames:
//! error and overload flags, their delimiter, intermission, suspended
//! transmission (ISO 11898-1:2015, 10.4, 10.12, 10.13 and 12.1.4).

use super::controller::{Controller, DOMINANT, Io, Mac, RECESSIVE};
use super::decoder::Decoder;
use super::types::{EventKind, WireError};

const FLAG_BITS: u32 = 6;
const DELIMITER_BITS: u32 = 8;
const INTERMISSION_BITS: u32 = 3;
/// A bus that stays dominant this long after a flag costs again.
const DOMINANT_RUN: u32 = 8;

impl Controller {
    /// An error: counts, tells, and sends the flag that the error state
    /// before this error allows (12.1.4: the error that makes a node passive
    /// is still flagged actively).
    pub(super) fn fail(&mut self, error: WireError, io: &mut Io) {
        let passive = self.counters.is_passive();
        let ack = passive && error == WireError::Ack;
        // Rule c, exceptions: a passive transmitter without acknowledgement
        // counts only if someone disturbs its flag, and a recessive stuff bit
        // overwritten during arbitration does not count.
        let exempt = ack || error == WireError::Stuff;
        if !self.transmitter {
            self.counters.receive_error();
            io.emit(EventKind::RxError { error });
        } else if !exempt {
            self.counters.transmit_error();
        }
        if let Some(tx) = self.tx.take() {
            io.emit(EventKind::TxError { tag: tx.tag, error });
        }
        if passive {
            self.mac = Mac::PassiveFlag {
                last: RECESSIVE,
                run: 0,
                ack,
            };
        } else {
            self.mac = Mac::Flag {
                sent: 0,
                overload: false,
            };
            self.next_drive = DOMINANT;
        }
    }

    pub(super) fn overload(&mut self) {
        self.mac = Mac::Flag {
            sent: 0,
            overload: true,
        };
        self.next_drive = DOMINANT;
    }

    /// Counts an error that the standard weighs with 8, whatever the role.
    fn heavy_error(&mut self) {
        if self.transmitter {
            self.counters.transmit_error();
        } else {
            self.counters.receive_error_heavy();
        }
    }

    pub(super) fn flag(&mut self, sent: u32, overload: bool, level: bool) {
        if level == RECESSIVE {
            self.heavy_error(); // Rules d and e.
        }
        let sent = sent + 1;
        if sent == FLAG_BITS {
            self.mac = Mac::FlagOver {
                dominant: 0,
                overload,
            };
        } else {
            self.mac = Mac::Flag { sent, overload };
            self.next_drive = DOMINANT;
        }
    }

    pub(super) fn passive_flag(&mut self, last: bool, run: u32, ack: bool, level: bool) {
        if ack && level == DOMINANT {
            self.counters.transmit_error();
        }
        let ack = ack && level == RECESSIVE;
        let run = if level == last { run + 1 } else { 1 };
        self.mac = if run == FLAG_BITS {
            Mac::FlagOver {
                dominant: 0,
                overload: false,
            }
        } else {
            Mac::PassiveFlag {
                last: level,
                run,
                ack,
            }
        };
    }

    pub(super) fn flag_over(&mut self, dominant: u32, overload: bool, level: bool) {
        if level == RECESSIVE {
            self.mac = Mac::Delimiter { seen: 1 };
            return;
        }
        let dominant = dominant + 1;
        if dominant == 1 && !overload && !self.transmitter {
            self.counters.receive_error_heavy(); // Rule b.
        }
        if dominant.is_multiple_of(DOMINANT_RUN) {
            self.heavy_error(); // Rule f.
        }
        self.mac = Mac::FlagOver { dominant, overload };
    }

    pub(super) fn delimiter(&mut self, seen: u32, level: bool, io: &mut Io) {
        let seen = seen + 1;
        match (level, seen) {
            (DOMINANT, DELIMITER_BITS) => self.overload(),
            (DOMINANT, _) => self.fail(WireError::Form, io),
            (RECESSIVE, DELIMITER_BITS) => self.mac = Mac::Intermission(1),
            (RECESSIVE, _) => self.mac = Mac::Delimiter { seen },
        }
    }

    pub(super) fn intermission(&mut self, bit: u32, level: bool, io: &mut Io) {
        let suspends = self.transmitter && self.counters.is_passive();
        match (level, bit) {
            // 10.4: a dominant third bit is a start of frame, which whoever
            // waits joins with its identifier.
            (DOMINANT, INTERMISSION_BITS) => {
                let joins = !suspends && self.take_offer(io, io.bit_start);
                if joins {
                    self.rx = Decoder::new();
                    self.rx.push(DOMINANT);
                    self.mac = Mac::Stuffed;
                    self.next_bit();
                } else {
                    self.start_of_frame(io);
                }
            }
            (DOMINANT, _) => self.overload(),
            (RECESSIVE, INTERMISSION_BITS) => {
                self.transmitter = false;
                self.mac = if suspends { Mac::Suspend(1) } else { Mac::Idle };
            }
            (RECESSIVE, _) => self.mac = Mac::Intermission(bit + 1),
        }
    }
}
