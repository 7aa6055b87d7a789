//! Why a node was not booted: the error status of CiA 302-2 with its facts.

use crate::id::Address;
use crate::sdo::AbortCode;
use core::fmt;

/// Error status of the boot-up of a node (CiA 302-2, table "Error status of
/// the boot slave process").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// No answer when the device type (1000h) was asked for.
    B,
    /// The device type is not the expected one (1F84h).
    C,
    /// The vendor-ID is not the expected one (1F85h).
    D,
    /// The configuration could not be written.
    J,
    /// No heartbeat came after the configuration.
    K,
    /// The product code is not the expected one (1F86h).
    M,
    /// The revision number is not the expected one (1F87h).
    N,
    /// The serial number is not the expected one (1F88h).
    O,
}

impl Status {
    /// The letter that the standard gives it.
    pub const fn letter(self) -> char {
        match self {
            Status::B => 'B',
            Status::C => 'C',
            Status::D => 'D',
            Status::J => 'J',
            Status::K => 'K',
            Status::M => 'M',
            Status::N => 'N',
            Status::O => 'O',
        }
    }
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cause {
    /// No boot-up frame within the boot time (1F89h).
    NoBootUp,
    /// It restarted again and again while it was being configured.
    Restarts,
    /// Its SDO server did not answer, however often it was asked.
    NoAnswer {
        /// The entry that was accessed.
        at: Address,
    },
    /// Its SDO server answered with an abort.
    Refused {
        /// The entry that was accessed.
        at: Address,
        /// Its reason.
        code: AbortCode,
    },
    /// Its SDO server answered something that is no answer to the request.
    Garbled {
        /// The entry that was accessed.
        at: Address,
    },
    /// It is not the device that belongs here.
    Mismatch {
        /// The entry that was read.
        at: Address,
        /// What the network description says.
        expected: u32,
        /// What the node says.
        found: u32,
    },
    /// No heartbeat within three of its periods.
    NoHeartbeat,
    /// It did not report operational after NMT start.
    NotOperational,
}

impl Cause {
    /// What to do about it.
    pub const fn advice(&self) -> &'static str {
        match self {
            Cause::NoBootUp => {
                "check its power supply, the bus wiring and termination, its node-ID and its bit rate"
            }
            Cause::Restarts => "check its power supply",
            Cause::NoAnswer { .. } | Cause::Garbled { .. } => {
                "check that no other node has the same node-ID, and the wiring"
            }
            Cause::Refused { .. } => {
                "compare the network description with the object dictionary of the drive"
            }
            Cause::Mismatch { .. } => {
                "connect the drive that the network names, or name this one in the network"
            }
            Cause::NoHeartbeat | Cause::NotOperational => {
                "check the drive's error memory (1003h) and the wiring"
            }
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Cause::NoBootUp => f.write_str("no boot-up frame"),
            Cause::Restarts => f.write_str("restarts again and again"),
            Cause::NoAnswer { at } => write!(f, "no answer to the access to {at}"),
            Cause::Refused { at, code } => write!(f, "access to {at} refused: {code}"),
            Cause::Garbled { at } => write!(f, "wrong answer to the access to {at}"),
            Cause::Mismatch {
                at,
                expected,
                found,
            } => {
                write!(f, "{at} is {found:08X}h, expected {expected:08X}h")
            }
            Cause::NoHeartbeat => f.write_str("no heartbeat after the configuration"),
            Cause::NotOperational => f.write_str("not operational after NMT start"),
        }
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Cause {
    fn format(&self, f: defmt::Formatter<'_>) {
        match *self {
            Cause::NoBootUp => defmt::write!(f, "no boot-up frame"),
            Cause::Restarts => defmt::write!(f, "restarts again and again"),
            Cause::NoAnswer { at } => defmt::write!(f, "no answer to the access to {}", at),
            Cause::Refused { at, code } => {
                defmt::write!(f, "access to {} refused: {}", at, code)
            }
            Cause::Garbled { at } => defmt::write!(f, "wrong answer to the access to {}", at),
            Cause::Mismatch {
                at,
                expected,
                found,
            } => {
                defmt::write!(f, "{} is {:08X}h, expected {:08X}h", at, found, expected)
            }
            Cause::NoHeartbeat => defmt::write!(f, "no heartbeat after the configuration"),
            Cause::NotOperational => defmt::write!(f, "not operational after NMT start"),
        }
    }
}

/// A node that was not booted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The letter of CiA 302-2.
    pub status: Status,
    /// The facts.
    pub cause: Cause,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Failure { status, cause } = self;
        write!(
            f,
            "{cause} (boot status {}); {}",
            status.letter(),
            cause.advice()
        )
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Failure {
    fn format(&self, f: defmt::Formatter<'_>) {
        let Failure { status, cause } = self;
        defmt::write!(
            f,
            "{} (boot status {}); {}",
            cause,
            status.letter(),
            cause.advice()
        );
    }
}
