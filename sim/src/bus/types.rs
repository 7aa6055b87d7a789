//! What the bus and the controllers on it say to each other.

use crate::frame::{WireFrame, WireId};
use crate::time::Time;
use std::fmt;

/// A node's place on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PortId(pub usize);

/// Bit timing of one node, in its own clock's idea of a picosecond turned
/// into true ones: the clock's error is included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Length of a bit in picoseconds of true time.
    pub bit_time_ps: u64,
    /// Sample point in thousandths of the bit.
    pub sample_point_permille: u16,
    /// (Re)synchronisation jump width in thousandths of the bit.
    pub sjw_permille: u16,
}

impl BitTiming {
    /// Timing at `bitrate` bit/s with a clock that is `ppm` parts per million
    /// fast, sample point 87.5 % and a jump width of 12.5 %.
    pub fn new(bitrate: u32, ppm: f64) -> BitTiming {
        let ps = crate::time::PS_PER_S as f64 / f64::from(bitrate) / (1.0 + ppm * 1e-6);
        BitTiming {
            bit_time_ps: ps.round() as u64,
            sample_point_permille: 875,
            sjw_permille: 125,
        }
    }
}

/// What a controller would send next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Offer {
    /// The frame.
    pub frame: WireFrame,
    /// Request plus the controller's stated delay: SOF is never before.
    pub ready_at: Time,
    /// Comes back in the events of this frame.
    pub tag: u32,
}

/// Something that a controller learns from the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// When.
    pub at: Time,
    /// To whom.
    pub port: PortId,
    /// What.
    pub kind: EventKind,
}

/// See [`Event`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// SOF went out (again): the frame is latched and the offer forgotten.
    TxStarted {
        /// Of the offer.
        tag: u32,
    },
    /// The frame was acknowledged and its end of frame was undisturbed: at the
    /// sample point of its last bit, before the intermission.
    TxDone {
        /// Of the offer.
        tag: u32,
        /// Its start of frame.
        sof: Time,
    },
    /// A frame of higher priority goes first; offer again.
    ArbitrationLost {
        /// Of the offer.
        tag: u32,
    },
    /// The frame was destroyed; offer it again to retransmit (the bus keeps
    /// no copy).
    TxError {
        /// Of the offer.
        tag: u32,
        /// What the transmitter saw.
        error: WireError,
    },
    /// A frame that this node did not send was destroyed.
    RxError {
        /// What this receiver saw.
        error: WireError,
    },
    /// A frame arrived: at the sample point of the last but one bit of its end
    /// of frame, from which on it is valid. Not for its sender.
    Rx {
        /// The frame.
        frame: WireFrame,
        /// Its start of frame.
        sof: Time,
    },
    /// Error counters or error state changed.
    Counters {
        /// Transmit error counter, 0..=256 and above in bus-off.
        tec: u16,
        /// Receive error counter.
        rec: u16,
        /// What follows from them.
        state: ErrorState,
    },
}

/// Fault confinement state (ISO 11898-1:2015, 12.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ErrorState {
    /// Error active, both counters below 96.
    Active,
    /// Error active, a counter has reached 96.
    Warning,
    /// Error passive: a counter exceeds 127.
    Passive,
    /// The transmit error counter exceeds 255: off the bus.
    BusOff,
}

/// Kinds of error on the wire, by the names of the FDCAN's LEC field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum WireError {
    /// Six equal bits where stuffing forbids them.
    Stuff,
    /// A fixed-form bit was dominant.
    Form,
    /// No acknowledgement.
    Ack,
    /// Sent recessive, saw dominant.
    Bit1,
    /// Sent dominant, saw recessive.
    Bit0,
    /// The CRC sequence does not match.
    Crc,
}

impl fmt::Display for WireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            WireError::Stuff => "stuff error",
            WireError::Form => "form error",
            WireError::Ack => "acknowledgement error",
            WireError::Bit1 => "bit error (recessive sent, dominant seen)",
            WireError::Bit0 => "bit error (dominant sent, recessive seen)",
            WireError::Crc => "CRC error",
        })
    }
}

/// One occupation of the bus, from start of frame to the end of the
/// interframe space.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WireRecord {
    /// The leading edge of the start of frame.
    pub sof: Time,
    /// End of the interframe space: the earliest start of the next frame.
    pub end: Time,
    /// Bits between the two, stuff bits and interframe space included.
    pub bits: u32,
    /// Who sent it: several if identical frames started together; those that
    /// lost arbitration are left out. Empty if no frame was being sent.
    pub transmitters: Vec<PortId>,
    /// What it was.
    pub kind: RecordKind,
}

/// See [`WireRecord`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordKind {
    /// A frame that its transmitter saw acknowledged and undisturbed.
    Frame(WireFrame),
    /// A frame cut short, with the error flags and the error delimiter.
    ErrorFrame {
        /// The frame that was being sent, if there was one.
        frame: Option<WireFrame>,
        /// The first error that a node detected.
        error: WireError,
    },
}

/// A disturbance to order from [`Bus::inject`](super::Bus::inject).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BusFault {
    /// Noise: at random moments (seeded) the level is inverted for one bit,
    /// for all nodes, on the idle bus too.
    BitErrors {
        /// Mean share of disturbed bits, e.g. 1e-5.
        rate: f64,
        /// From here
        from: Time,
        /// until here.
        until: Time,
    },
    /// Inverts one bit of the next frame with this identifier that gets as
    /// far as that bit.
    FlipBit {
        /// The frame's identifier; data and remote frames both count.
        id: WireId,
        /// Bit on the wire, stuff bits counted, SOF = 0.
        bit: u32,
        /// Only this node sees it inverted; `None` = all do.
        seen_by: Option<PortId>,
    },
    /// The cable is open: an isolated node hears only itself.
    Cut {
        /// This node is cut off; `None` = every node is alone.
        isolated: Option<PortId>,
        /// From here
        from: Time,
        /// until here.
        until: Time,
    },
    /// The bus is held dominant (a short circuit, a broken transceiver).
    StuckDominant {
        /// From here
        from: Time,
        /// until here.
        until: Time,
    },
}
