//! Why a node was not booted: the error status of CiA 302-2 with its facts.

use crate::id::Address;
use crate::sdo::AbortCode;
use crate::words::in_words;

/// Error status of the boot-up of a node (CiA 302-2, table "Error status of
/// the boot slave process"). G, H and I belong to the check and the update of
/// the node's program, which this master does not offer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[repr(u8)]
pub enum Status {
    /// The node is not in the list of this master (1F81h, bit 0).
    A = b'A',
    /// No answer when the device type (1000h) was asked for.
    B = b'B',
    /// The device type is not the expected one (1F84h).
    C = b'C',
    /// The vendor-ID is not the expected one (1F85h).
    D = b'D',
    /// No heartbeat told the state of a node that is to be kept alive.
    E = b'E',
    /// No answer to node guarding told the state of a node that is to be kept
    /// alive.
    F = b'F',
    /// The configuration could not be written.
    J = b'J',
    /// No heartbeat, or no answer to node guarding, came after the
    /// configuration.
    K = b'K',
    /// The node was operational already and is left running: a success.
    L = b'L',
    /// The product code is not the expected one (1F86h).
    M = b'M',
    /// The revision number is not the expected one (1F87h).
    N = b'N',
    /// The serial number is not the expected one (1F88h).
    O = b'O',
}

impl Status {
    /// The letter that the standard gives it.
    pub const fn letter(self) -> char {
        self as u8 as char
    }
}

/// What happened; in words together with what to do about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cause {
    /// The network description or 1F81h leaves it out.
    NotListed,
    /// No boot-up frame within the boot time (1F89h).
    NoBootUp,
    /// It restarted again and again while it was being booted.
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
    /// It did not tell its NMT state, so that nobody knows whether it runs.
    NoState,
    /// No heartbeat within three of its periods, or no answer to node guarding.
    NoHeartbeat,
    /// It did not report operational after NMT start.
    NotOperational,
}

in_words!(Cause {
    Cause::NotListed => ("not in the list of this master; set bit 0 of 1F81h for it"),
    Cause::NoBootUp => (
        "no boot-up frame; check its power supply, the bus wiring and termination, its node-ID and its bit rate"
    ),
    Cause::Restarts => ("restarts again and again; check its power supply"),
    Cause::NoAnswer { at } => (
        "no answer to the access to {}; check that no other node has the same node-ID, and the wiring", at
    ),
    Cause::Refused { at, code } => (
        "access to {} refused: {}; compare the network description with the object dictionary of the drive", at, code
    ),
    Cause::Garbled { at } => (
        "wrong answer to the access to {}; check that no other node has the same node-ID, and the wiring", at
    ),
    Cause::Mismatch { at, expected, found } => (
        "{} is {:08X}h, expected {:08X}h; connect the drive that the network names, or name this one in the network",
        at, found, expected
    ),
    Cause::NoState => (
        "does not tell its NMT state; check the heartbeat time or the guard time that it was given"
    ),
    Cause::NoHeartbeat => (
        "no heartbeat after the configuration; check the drive's error memory (1003h) and the wiring"
    ),
    Cause::NotOperational => (
        "not operational after NMT start; check the drive's error memory (1003h) and the wiring"
    ),
});

/// A node that was not booted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The letter of CiA 302-2.
    pub status: Status,
    /// The facts.
    pub cause: Cause,
}

in_words!(Failure {
    Failure { status, cause } => (
        "boot status {}: {}", status.letter(), cause
    ),
});

/// How far the boot-up of a node came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BootResult {
    /// Not begun, or not at its end.
    Pending,
    /// Booted: no letter.
    Booted,
    /// Found operational and left so: L.
    LeftRunning,
    /// Not booted.
    Failed(Failure),
}

impl BootResult {
    /// The error status, where there is one.
    pub const fn status(&self) -> Option<Status> {
        match self {
            BootResult::Pending | BootResult::Booted => None,
            BootResult::LeftRunning => Some(Status::L),
            BootResult::Failed(failure) => Some(failure.status),
        }
    }
}

in_words!(BootResult {
    BootResult::Pending => ("not booted yet"),
    BootResult::Booted => ("booted"),
    BootResult::LeftRunning => ("was operational already and is left running (boot status L)"),
    BootResult::Failed(failure) => ("{}", failure),
});
