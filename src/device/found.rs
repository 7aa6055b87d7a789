//! What stands behind an entry of the dictionary.

use super::settings::Setting;
use crate::id::NodeId;
use crate::od::{Access, DataType, Entry};
use crate::pdo::Direction;
use crate::sdo::AbortCode;

/// An entry and where its value comes from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) entry: Entry,
    pub(super) item: Item,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Item {
    /// Follows from the design.
    Number(u32),
    /// A string that never changes.
    Text(&'static str),
    /// What a client may change and 1010h saves.
    Setting(Setting),
    /// 1001h
    ErrorRegister,
    /// 1002h
    Status,
    /// 1003h:00
    ErrorCount,
    /// 1003h, counted from 0
    ErrorField(u8),
    /// 1010h:01
    Save,
    /// 1011h:01
    Restore,
    /// 1F22h
    ConciseDcf(NodeId),
    /// 1F25h; `None`: all nodes
    Configure(Option<NodeId>),
    /// 1F82h; `None`: all nodes
    NmtRequest(Option<NodeId>),
    /// 2F00h
    BootLetter(NodeId),
    /// 2F01h
    BootWords(NodeId),
    /// 2F02h
    EmcyWords(NodeId),
    /// 2F10h
    Clock,
    /// 2F80h + node-ID, sub 0
    EmcyCount(NodeId),
    /// 2F80h + node-ID, counted from 0
    EmcyField(NodeId, u8),
    /// 3000h + node-ID
    Process(Process),
}

/// A field of the process image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Process {
    pub(super) node: NodeId,
    /// As seen from the node.
    pub(super) direction: Direction,
    /// 1 ..= 4.
    pub(super) number: u8,
    /// The first bit of the field in the PDO.
    pub(super) first_bit: u8,
    pub(super) bits: u8,
}

pub(super) type Lookup = Result<Found, AbortCode>;

impl Found {
    pub(super) const fn number(data_type: DataType, value: u32) -> Found {
        Found::with(data_type, Access::Constant, Item::Number(value))
    }

    /// Sub-index 0 of a record or an array.
    pub(super) const fn highest(sub: u8) -> Found {
        Found::number(DataType::Unsigned8, sub as u32)
    }

    pub(super) const fn text(text: &'static str) -> Found {
        Found::with(DataType::VisibleString, Access::Constant, Item::Text(text))
    }

    pub(super) const fn setting(setting: Setting) -> Found {
        Found::with(
            setting.data_type(),
            Access::ReadWrite,
            Item::Setting(setting),
        )
    }

    pub(super) const fn with(data_type: DataType, access: Access, item: Item) -> Found {
        Found {
            entry: Entry::new(data_type, access),
            item,
        }
    }

    pub(super) const fn limited(self, min: i64, max: i64) -> Found {
        Found {
            entry: self.entry.limited(min, max),
            ..self
        }
    }
}

/// A variable has sub-index 0 alone.
pub(super) const fn variable(sub: u8, found: Found) -> Lookup {
    match sub {
        0 => Ok(found),
        _ => Err(AbortCode::NO_SUCH_SUB_INDEX),
    }
}

/// An array whose sub-index is the node-ID.
pub(super) fn per_node(sub: u8, found: impl FnOnce(NodeId) -> Found) -> Lookup {
    match NodeId::new(sub) {
        Some(node) => Ok(found(node)),
        None if sub == 0 => Ok(Found::highest(NodeId::MAX.get())),
        None => Err(AbortCode::NO_SUCH_SUB_INDEX),
    }
}
