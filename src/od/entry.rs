//! What is known of an entry without its value.

use super::value::{DataType, Value};
use crate::sdo::AbortCode;

/// Access of an entry (CiA 301, 7.4.5, table 42).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Access {
    /// `ro`
    ReadOnly,
    /// `wo`
    WriteOnly,
    /// `rw`
    ReadWrite,
    /// `const`: read only, and the value never changes.
    Constant,
}

impl Access {
    /// # Errors
    /// 06010001h if the entry cannot be read.
    pub const fn readable(self) -> Result<(), AbortCode> {
        match self {
            Access::WriteOnly => Err(AbortCode::WRITE_ONLY),
            _ => Ok(()),
        }
    }

    /// # Errors
    /// 06010002h if the entry cannot be written.
    pub const fn writable(self) -> Result<(), AbortCode> {
        match self {
            Access::ReadOnly | Access::Constant => Err(AbortCode::READ_ONLY),
            Access::WriteOnly | Access::ReadWrite => Ok(()),
        }
    }
}

/// Into which PDOs an entry can be mapped (CiA 301, 7.4.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mappable {
    /// Not at all.
    No,
    /// `rww`: the device receives it.
    Rpdo,
    /// `rwr`: the device transmits it.
    Tpdo,
    /// Either.
    Both,
}

/// What the dictionary knows of an entry apart from its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Entry {
    /// The type, and with it the size.
    pub data_type: DataType,
    /// Access by SDO.
    pub access: Access,
    /// Access by PDO.
    pub mappable: Mappable,
    /// Lowest and highest value that can be written.
    pub range: Option<(i64, i64)>,
}

impl Entry {
    /// An entry that is neither mappable nor limited in range.
    pub const fn new(data_type: DataType, access: Access) -> Entry {
        Entry {
            data_type,
            access,
            mappable: Mappable::No,
            range: None,
        }
    }

    /// The same, mappable.
    pub const fn mappable(self, mappable: Mappable) -> Entry {
        Entry { mappable, ..self }
    }

    /// The same, limited to `min..=max`.
    pub const fn limited(self, min: i64, max: i64) -> Entry {
        Entry {
            range: Some((min, max)),
            ..self
        }
    }

    /// # Errors
    /// 06010001h if the entry cannot be read.
    pub const fn readable(&self) -> Result<(), AbortCode> {
        self.access.readable()
    }

    /// # Errors
    /// 06010002h if the entry cannot be written.
    pub const fn writable(&self) -> Result<(), AbortCode> {
        self.access.writable()
    }

    /// # Errors
    /// 06090030h if the value is out of range.
    pub fn in_range(&self, value: Value) -> Result<(), AbortCode> {
        match self.range {
            Some((min, max)) if !(min..=max).contains(&value.as_i64()) => {
                Err(AbortCode::VALUE_RANGE)
            }
            _ => Ok(()),
        }
    }
}
