//! Why a request of the client failed.

use super::abort::AbortCode;
use crate::id::Address;
use crate::time::Duration;
use core::fmt;

/// Why an SDO request failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SdoError {
    /// The server did not answer in time; it has been sent 05040000h.
    Timeout {
        /// The entry.
        at: Address,
        /// How long the client waited.
        waited: Duration,
    },
    /// The server refused.
    Aborted {
        /// The entry.
        at: Address,
        /// Its reason.
        code: AbortCode,
    },
    /// The server broke the protocol; it has been sent this code.
    Protocol {
        /// The entry.
        at: Address,
        /// What the server did wrong.
        code: AbortCode,
    },
    /// The answer is longer than the client has room for; it has been aborted
    /// with 05040005h.
    NoRoom {
        /// The entry.
        at: Address,
        /// The size that the server announced, or the bytes received so far.
        size: u32,
    },
    /// The answer has more or fewer bytes than the server announced.
    Size {
        /// The entry.
        at: Address,
        /// What the server announced.
        announced: u32,
        /// What came.
        received: u32,
    },
    /// The caller cancelled the request; the server has been sent this code.
    Cancelled {
        /// The entry.
        at: Address,
        /// The caller's reason.
        code: AbortCode,
    },
}

impl SdoError {
    /// The entry that the request was about.
    pub const fn address(&self) -> Address {
        match *self {
            SdoError::Timeout { at, .. }
            | SdoError::Aborted { at, .. }
            | SdoError::Protocol { at, .. }
            | SdoError::NoRoom { at, .. }
            | SdoError::Size { at, .. }
            | SdoError::Cancelled { at, .. } => at,
        }
    }

    /// The abort code that was received or sent.
    pub const fn code(&self) -> AbortCode {
        match *self {
            SdoError::Timeout { .. } => AbortCode::TIMEOUT,
            SdoError::Aborted { code, .. }
            | SdoError::Protocol { code, .. }
            | SdoError::Cancelled { code, .. } => code,
            SdoError::NoRoom { .. } => AbortCode::OUT_OF_MEMORY,
            SdoError::Size { .. } => AbortCode::LENGTH_MISMATCH,
        }
    }
}

impl fmt::Display for SdoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            SdoError::Timeout { at, waited } => write!(
                f,
                "{at}: no answer within {} ms; check the node's supply, node-ID and bit rate",
                waited.as_millis()
            ),
            SdoError::Aborted { at, code } => write!(
                f,
                "{at}: refused with {code}; compare with the node's object dictionary"
            ),
            SdoError::Protocol { at, code } => write!(
                f,
                "{at}: the node broke the SDO protocol: {code}; \
                 check that no other node has its node-ID"
            ),
            SdoError::NoRoom { at, size } => write!(
                f,
                "{at}: the answer has at least {size} bytes, more than there is room for; \
                 read it with room for all of it"
            ),
            SdoError::Size {
                at,
                announced,
                received,
            } => write!(
                f,
                "{at}: the node announced {announced} bytes and sent {received}; \
                 check that no other node has its node-ID"
            ),
            SdoError::Cancelled { at, code } => {
                write!(f, "{at}: cancelled by the caller with {code}")
            }
        }
    }
}

impl core::error::Error for SdoError {}
