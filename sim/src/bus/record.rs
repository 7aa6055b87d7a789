//! What was on the wire, put together from what its nodes went through.

use super::types::{EventKind, PortId, RecordKind, WireError, WireRecord};
use crate::frame::WireFrame;
use crate::time::Time;

/// The record that is being written.
#[derive(Clone, Debug)]
struct Open {
    sof: u64,
    /// The node whose bits are counted and whose intermission ends it.
    lead: usize,
    transmitters: Vec<PortId>,
    frame: Option<WireFrame>,
    error: Option<WireError>,
    done: bool,
}

/// All records so far, and the one that is being written.
#[derive(Debug, Default)]
pub(super) struct Recorder {
    finished: Vec<WireRecord>,
    open: Option<Open>,
    /// Where the last finished one ends.
    end: Time,
}

impl Recorder {
    pub(super) fn push(&mut self, record: WireRecord) {
        self.end = record.end;
        self.finished.push(record);
    }

    pub(super) fn take(&mut self) -> Vec<WireRecord> {
        std::mem::take(&mut self.finished)
    }

    /// The node whose intermission ends the open record.
    pub(super) fn lead(&self) -> Option<usize> {
        self.open.as_ref().map(|open| open.lead)
    }

    pub(super) fn set_lead(&mut self, lead: usize) {
        if let Some(open) = &mut self.open {
            open.lead = lead;
        }
    }

    /// A node sends its start of frame.
    pub(super) fn started(&mut self, port: usize, frame: WireFrame, sof: u64, bit: u64) {
        let joins = |open: &&mut Open| !open.done && open.error.is_none() && sof < open.sof + bit;
        if let Some(open) = self.open.as_mut().filter(joins) {
            open.transmitters.push(PortId(port));
            return;
        }
        self.close(sof, bit);
        self.open = Some(Open {
            sof,
            lead: port,
            transmitters: vec![PortId(port)],
            frame: Some(frame),
            error: None,
            done: false,
        });
    }

    /// Something that `port` told; `sof` is the start of the frame that it
    /// followed, `flags` whether it makes errors visible.
    pub(super) fn told(&mut self, port: usize, kind: &EventKind, sof: u64, flags: bool) {
        let error = match *kind {
            EventKind::TxError { error, .. } | EventKind::RxError { error } => error,
            EventKind::ArbitrationLost { .. } => return self.lost(PortId(port)),
            EventKind::TxDone { .. } => {
                if let Some(open) = &mut self.open {
                    open.done = true;
                }
                return;
            }
            _ => return,
        };
        match &mut self.open {
            Some(open) => {
                open.error.get_or_insert(error);
            }
            None if flags => {
                self.open = Some(Open {
                    // A stranger to the bit rate may believe itself in a frame
                    // since before the last one.
                    sof: sof.max(self.end.0),
                    lead: port,
                    transmitters: Vec::new(),
                    frame: None,
                    error: Some(error),
                    done: false,
                });
            }
            None => {}
        }
    }

    fn lost(&mut self, port: PortId) {
        if let Some(open) = &mut self.open {
            open.transmitters.retain(|other| *other != port);
            if let Some(lead) = open.transmitters.first() {
                open.lead = lead.0;
            }
        }
    }

    /// A frame that won over the one noted first.
    pub(super) fn carries(&mut self, frame: WireFrame) {
        if let Some(open) = &mut self.open {
            open.frame = Some(frame);
        }
    }

    /// The interframe space of `port` is over; if it leads, so is the record.
    /// One that has only just begun belongs to the next frame.
    pub(super) fn interframe_over(&mut self, port: usize, end: u64, bit: u64) {
        let ours = |open: &Open| open.lead == port && open.sof + bit < end;
        if self.open.as_ref().is_some_and(ours) {
            self.close(end, bit);
        }
    }

    /// Ends the record; `bit` is the lead's bit time.
    pub(super) fn close(&mut self, end: u64, bit: u64) {
        let Some(open) = self.open.take() else {
            return;
        };
        let kind = match open.frame {
            Some(frame) if open.done => RecordKind::Frame(frame),
            // A frame that broke off where nobody was left to notice would
            // have been a stuff error.
            frame => RecordKind::ErrorFrame {
                frame,
                error: open.error.unwrap_or(WireError::Stuff),
            },
        };
        let end = end.max(open.sof);
        self.push(WireRecord {
            sof: Time(open.sof),
            end: Time(end),
            bits: ((end - open.sof + bit / 2) / bit.max(1)) as u32,
            transmitters: open.transmitters,
            kind,
        });
    }
}
