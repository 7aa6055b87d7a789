//! One node's protocol controller: what it does at each of its sample points
//! (ISO 11898-1:2015, 10.4 to 10.11).

use super::confinement::Counters;
use super::decoder::{Decoder, Progress};
use super::types::{ErrorState, Event, EventKind, Offer, PortId, WireError};
use crate::frame::{BitString, WireFrame, WireId};
use crate::time::Time;

pub(super) const RECESSIVE: bool = true;
pub(super) const DOMINANT: bool = false;

/// Recessive bits after which a node takes part in the traffic.
const INTEGRATION_BITS: u32 = 11;
/// Such sequences that end bus-off.
const BUS_OFF_SEQUENCES: u32 = 129;
const SUSPEND_BITS: u32 = 8;

// The part of a frame behind the CRC sequence, by bit.
const CRC_DELIMITER: u32 = 0;
const ACK_SLOT: u32 = 1;
const ACK_DELIMITER: u32 = 2;
const LAST_BUT_ONE: u32 = 8;
const LAST: u32 = 9;

/// Last bit of the arbitration field without stuffing: the RTR bit.
const BASE_ARBITRATION_END: u32 = 12;
const EXTENDED_ARBITRATION_END: u32 = 32;

/// What the controller is doing in the bit that runs now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mac {
    /// INIT, without power, or bus-off.
    Off,
    /// Waiting for 11 recessive bits, `left` times.
    Integrating {
        run: u32,
        left: u32,
    },
    Idle,
    /// SOF to CRC.
    Stuffed,
    /// CRC delimiter to the end of EOF.
    Tail(u32),
    /// Six dominant bits, as active error flag or as overload flag.
    Flag {
        sent: u32,
        overload: bool,
    },
    /// Six equal bits, whoever sends them.
    PassiveFlag {
        last: bool,
        run: u32,
        ack: bool,
    },
    /// Recessive after a flag, until the bus is.
    FlagOver {
        dominant: u32,
        overload: bool,
    },
    /// Error or overload delimiter, `seen` recessive bits so far.
    Delimiter {
        seen: u32,
    },
    /// Bit 1..=3.
    Intermission(u32),
    /// Bit 1..=8: an error passive transmitter lets others go first.
    Suspend(u32),
}

/// The frame that a node is sending.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tx {
    frame: WireFrame,
    pub(super) tag: u32,
    bits: BitString,
    /// The bit on the wire now.
    index: u32,
}

/// Surroundings of one sample.
pub(super) struct Io<'a> {
    pub(super) now: u64,
    /// Start of the sampled bit.
    pub(super) bit_start: u64,
    pub(super) port: PortId,
    pub(super) offer: &'a mut Option<Offer>,
    pub(super) out: &'a mut Vec<Event>,
}

impl Io<'_> {
    pub(super) fn emit(&mut self, kind: EventKind) {
        self.out.push(Event {
            at: Time(self.now),
            port: self.port,
            kind,
        });
    }
}

#[derive(Clone, Debug)]
pub(super) struct Controller {
    pub(super) mac: Mac,
    pub(super) counters: Counters,
    /// What it puts on the bus in the bit that runs now.
    pub(super) drive: bool,
    /// What it puts there in the next bit.
    pub(super) next_drive: bool,
    pub(super) tx: Option<Tx>,
    /// It sent (or sends) the frame that the bus is busy with.
    pub(super) transmitter: bool,
    pub(super) rx: Decoder,
    sof: u64,
}

impl Controller {
    pub(super) fn new() -> Controller {
        Controller {
            mac: Mac::Off,
            counters: Counters::default(),
            drive: RECESSIVE,
            next_drive: RECESSIVE,
            tx: None,
            transmitter: false,
            rx: Decoder::new(),
            sof: 0,
        }
    }

    pub(super) fn is_off(&self) -> bool {
        self.mac == Mac::Off
    }

    pub(super) fn is_idle(&self) -> bool {
        self.mac == Mac::Idle
    }

    /// Start of the frame that it takes part in.
    pub(super) fn sof(&self) -> u64 {
        self.sof
    }

    /// The frame and its bit that is on the wire now, while it is sending.
    pub(super) fn sending(&self) -> Option<(&WireFrame, u32)> {
        self.tx.as_ref().map(|tx| (&tx.frame, tx.index))
    }

    /// The frame that it sent got through and the intermission is over. True
    /// if it has to let others go first.
    pub(super) fn has_transmitted(&mut self) -> bool {
        self.counters.transmitted();
        let suspends = self.counters.is_passive();
        if suspends {
            self.mac = Mac::Suspend(1);
        }
        suspends
    }

    /// Leaves the bus; the counters stay.
    pub(super) fn switch_off(&mut self) {
        *self = Controller {
            counters: self.counters,
            ..Controller::new()
        };
    }

    /// Joins the bus: after 11 recessive bits, or 129 times 11 from bus-off.
    pub(super) fn switch_on(&mut self) {
        self.switch_off();
        let left = if self.counters.is_bus_off() {
            BUS_OFF_SEQUENCES
        } else {
            1
        };
        self.mac = Mac::Integrating { run: 0, left };
    }

    /// Whether a recessive to dominant edge restarts its bit (11.3.2: bus
    /// integration, idle, suspend, and all of the intermission but its first
    /// bit).
    pub(super) fn takes_hard_sync(&self) -> bool {
        match self.mac {
            Mac::Integrating { .. } | Mac::Idle | Mac::Suspend(_) => true,
            Mac::Intermission(bit) => bit > 1,
            _ => false,
        }
    }

    /// Whether it would not follow a late edge, being the one that made it.
    pub(super) fn drives_dominant(&self) -> bool {
        self.drive == DOMINANT
    }

    /// A bit begins: the idle controller may start a frame.
    pub(super) fn begin_bit(&mut self, io: &mut Io) {
        self.drive = self.next_drive;
        if self.is_idle() && self.take_offer(io, io.now) {
            self.mac = Mac::Stuffed;
            self.rx = Decoder::new();
            self.drive = DOMINANT;
        }
    }

    /// Latches the offered frame, if there is one ready.
    pub(super) fn take_offer(&mut self, io: &mut Io, sof: u64) -> bool {
        let Some(offer) = io.offer.take_if(|offer| offer.ready_at.0 <= io.now) else {
            return false;
        };
        self.tx = Some(Tx {
            frame: offer.frame,
            tag: offer.tag,
            bits: offer.frame.encode(),
            index: 0,
        });
        self.transmitter = true;
        self.sof = sof;
        io.emit(EventKind::TxStarted { tag: offer.tag });
        true
    }

    /// The sample point of a bit: `level` is what it sees.
    pub(super) fn sample(&mut self, level: bool, io: &mut Io) {
        let before = self.counters;
        self.next_drive = RECESSIVE;
        match self.mac {
            Mac::Off => {}
            Mac::Integrating { run, left } => self.integrate(level, run, left),
            Mac::Idle if level == DOMINANT => self.start_of_frame(io),
            Mac::Idle => {}
            Mac::Stuffed => self.stuffed(level, io),
            Mac::Tail(bit) => self.tail(bit, level, io),
            Mac::Flag { sent, overload } => self.flag(sent, overload, level),
            Mac::PassiveFlag { last, run, ack } => self.passive_flag(last, run, ack, level),
            Mac::FlagOver { dominant, overload } => self.flag_over(dominant, overload, level),
            Mac::Delimiter { seen } => self.delimiter(seen, level, io),
            Mac::Intermission(bit) => self.intermission(bit, level, io),
            Mac::Suspend(_) if level == DOMINANT => self.start_of_frame(io),
            Mac::Suspend(SUSPEND_BITS) => self.mac = Mac::Idle,
            Mac::Suspend(bit) => self.mac = Mac::Suspend(bit + 1),
        }
        if self.counters.is_bus_off() && !matches!(self.mac, Mac::Integrating { .. }) {
            self.switch_off();
        }
        if self.counters != before {
            io.emit(self.counters.report());
        }
    }

    fn integrate(&mut self, level: bool, run: u32, left: u32) {
        let run = if level == RECESSIVE { run + 1 } else { 0 };
        self.mac = if run < INTEGRATION_BITS {
            Mac::Integrating { run, left }
        } else if left > 1 {
            Mac::Integrating {
                run: 0,
                left: left - 1,
            }
        } else {
            if self.counters.state() == ErrorState::BusOff {
                self.counters = Counters::default();
            }
            Mac::Idle
        };
    }

    /// The sampled bit was another node's SOF.
    pub(super) fn start_of_frame(&mut self, io: &mut Io) {
        self.transmitter = false;
        self.tx = None;
        self.sof = io.bit_start;
        self.rx = Decoder::new();
        self.rx.push(DOMINANT);
        self.mac = Mac::Stuffed;
    }

    fn stuffed(&mut self, level: bool, io: &mut Io) {
        if let Some(tx) = &self.tx {
            let sent = tx.bits.get(tx.index);
            let arbitration_end = match tx.frame.id {
                WireId::Standard(_) => BASE_ARBITRATION_END,
                WireId::Extended(_) => EXTENDED_ARBITRATION_END,
            };
            let arbitrates = self.rx.len() <= arbitration_end;
            if sent == DOMINANT && level == RECESSIVE {
                return self.fail(WireError::Bit0, io);
            }
            if sent == RECESSIVE && level == DOMINANT {
                if !arbitrates {
                    return self.fail(WireError::Bit1, io);
                }
                // A stuff bit that turns dominant is left to the stuff check.
                if !self.rx.expects_stuff_bit() {
                    io.emit(EventKind::ArbitrationLost { tag: tx.tag });
                    self.tx = None;
                    self.transmitter = false;
                }
            }
        }
        match self.rx.push(level) {
            Progress::More => {}
            Progress::Complete => self.mac = Mac::Tail(CRC_DELIMITER),
            Progress::StuffError => return self.fail(WireError::Stuff, io),
        }
        self.next_bit();
    }

    pub(super) fn next_bit(&mut self) {
        if let Some(tx) = &mut self.tx {
            tx.index += 1;
            self.next_drive = tx.bits.get(tx.index);
        }
    }

    fn tail(&mut self, bit: u32, level: bool, io: &mut Io) {
        let acknowledges = !self.transmitter && self.rx.crc_matches();
        match (bit, level) {
            (ACK_SLOT, RECESSIVE) if self.transmitter => return self.fail(WireError::Ack, io),
            (ACK_SLOT, RECESSIVE) if acknowledges => return self.fail(WireError::Bit0, io),
            (ACK_SLOT, _) => {}
            (LAST, DOMINANT) if !self.transmitter => return self.overload(),
            (_, DOMINANT) => return self.fail(WireError::Form, io),
            (ACK_DELIMITER, _) if !self.transmitter && !acknowledges => {
                return self.fail(WireError::Crc, io);
            }
            (LAST_BUT_ONE, _) if !self.transmitter => {
                self.counters.received();
                io.emit(EventKind::Rx {
                    frame: self.rx.frame(),
                    sof: Time(self.sof),
                });
            }
            _ => {}
        }
        self.mac = Mac::Tail(bit + 1);
        self.next_bit();
        if bit == CRC_DELIMITER && acknowledges {
            self.next_drive = DOMINANT;
        }
        if bit == LAST {
            self.mac = Mac::Intermission(1);
            if let Some(tx) = self.tx.take() {
                self.counters.transmitted();
                io.emit(EventKind::TxDone {
                    tag: tx.tag,
                    sof: Time(self.sof),
                });
            }
        }
    }
}
