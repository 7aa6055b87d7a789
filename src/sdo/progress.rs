//! What the client tells its caller.

use super::error::SdoError;
use super::response::{RESPONSE_MAX, Response};
use crate::frame::Frame;
use crate::time::Instant;
use core::fmt;

/// What the caller of the client has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use = "it may hold a frame that has to be sent"]
pub enum Progress<T = Response> {
    /// Nothing.
    Nothing,
    /// Send this frame.
    Send(Frame),
    /// The request is done.
    Done(T),
    /// The request has failed; send the abort if there is one.
    Failed(SdoError, Option<Frame>),
}

/// Why a request cannot be started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StartError {
    /// Another request is under way.
    Busy,
    /// The channel is closed after a failure.
    Quarantine {
        /// When it opens.
        until: Instant,
    },
    /// More than [`RESPONSE_MAX`] bytes, or none.
    Length(usize),
}

impl fmt::Display for StartError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StartError::Busy => f.write_str("another request is under way; await its end"),
            StartError::Quarantine { .. } => {
                f.write_str("the channel is closed for a while after a failure; try again later")
            }
            StartError::Length(len) => {
                write!(f, "{len} bytes cannot be sent, only 1 to {RESPONSE_MAX}")
            }
        }
    }
}

impl core::error::Error for StartError {}
