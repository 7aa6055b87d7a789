//! Electronic data sheets and device configuration files (CiA 306), as the
//! vendors really write them.
//!
//! Numbers may be decimal, hexadecimal or octal and contain `$NODEID`; names of
//! sections and keys may be in any case; lines may end in any way; sections that
//! the file announces may be missing, and sections that it does not announce may
//! be there. What cannot be read is told with its line and left out; whoever
//! needs it finds it missing.

mod ini;
mod number;
mod read;
mod write;

pub use number::Number;

use std::collections::BTreeMap;

use crate::object::{Access, Address, DataType};
use crate::problem::Problem;
use crate::source::Source;

/// A device as its EDS or DCF describes it.
#[derive(Clone, Debug, Default)]
pub struct Eds {
    /// The name of the file.
    pub file: String,
    /// `[DeviceInfo]`
    pub device: DeviceInfo,
    /// `[DeviceComissioning]`: the file is a DCF, and this is its node-ID.
    pub node_id: Option<u8>,
    /// Simple types that may stand in an RPDO for "not used", by index.
    pub dummies: Vec<u16>,
    /// The objects by index.
    pub objects: BTreeMap<u16, Object>,
}

/// Who made the device and what it can (CiA 306, 4.5.2).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceInfo {
    /// VendorName
    pub vendor_name: String,
    /// VendorNumber
    pub vendor: Option<u32>,
    /// ProductName
    pub product_name: String,
    /// ProductNumber
    pub product: Option<u32>,
    /// RevisionNumber
    pub revision: Option<u32>,
    /// LSS_Supported
    pub lss: bool,
    /// The bit rates that are named, in kbit/s, and whether they are there.
    pub bit_rates: BTreeMap<u32, bool>,
}

/// An object (CiA 306, 4.6.3).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// ParameterName
    pub name: String,
    /// Whether it has sub-indices: an array or a record.
    pub kind: ObjectKind,
    /// The line of its section.
    pub line: u32,
    /// Its entries by sub-index; a variable has 0 alone.
    pub entries: BTreeMap<u8, Entry>,
}

/// ObjectType of an EDS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectKind {
    /// DOMAIN, DEFTYPE or VAR: no sub-indices.
    Variable,
    /// ARRAY
    Array,
    /// RECORD or DEFSTRUCT
    Record,
}

/// One entry of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// ParameterName
    pub name: String,
    /// DataType
    pub data_type: DataType,
    /// AccessType
    pub access: Access,
    /// PDOMapping
    pub mappable: bool,
    /// LowLimit
    pub low: Option<Number>,
    /// HighLimit
    pub high: Option<Number>,
    /// DefaultValue of a number
    pub default: Option<Number>,
    /// DefaultValue as it stands there
    pub default_text: String,
    /// ParameterValue of a DCF
    pub parameter: Option<Number>,
    /// The line of its section.
    pub line: u32,
}

impl Eds {
    /// Reads a file. What cannot be read in it is told beside it.
    pub fn read(source: &Source) -> (Eds, Vec<Problem>) {
        read::read(source)
    }

    /// The entry at an address.
    pub fn entry(&self, at: Address) -> Option<&Entry> {
        self.objects.get(&at.index)?.entries.get(&at.sub)
    }

    /// All entries in their order.
    pub fn entries(&self) -> impl Iterator<Item = (Address, &Object, &Entry)> {
        self.objects.iter().flat_map(|(index, object)| {
            object
                .entries
                .iter()
                .map(move |(sub, entry)| (Address::new(*index, *sub), object, entry))
        })
    }

    /// The file as text, complete and in the order that the standard wants.
    pub fn write(&self) -> String {
        write::write(self)
    }
}

impl Object {
    /// The name of an entry: `Object.Entry`, or the object's alone.
    pub fn full_name(&self, sub: u8) -> String {
        match (self.kind, self.entries.get(&sub)) {
            (ObjectKind::Variable, _) | (_, None) => self.name.clone(),
            (_, Some(entry)) => format!("{}.{}", self.name, entry.name),
        }
    }
}
