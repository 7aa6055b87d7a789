//! Values of the types with a fixed size.

use crate::sdo::AbortCode;

/// The largest value of fixed size, in bytes.
pub const VALUE_MAX: usize = 8;

/// A data type (CiA 301, 7.4.7.1, table 44).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub enum DataType {
    Boolean,
    Integer8,
    Integer16,
    Integer32,
    Integer64,
    Unsigned8,
    Unsigned16,
    Unsigned32,
    Unsigned64,
    Real32,
    /// TIME_OF_DAY: U32 milliseconds since midnight (28 bits), U16 days since
    /// 1984-01-01.
    TimeOfDay,
    VisibleString,
    OctetString,
    Domain,
}

impl DataType {
    /// The size in bytes; `None` for strings and domains.
    pub const fn size(self) -> Option<usize> {
        Some(match self {
            DataType::Boolean | DataType::Integer8 | DataType::Unsigned8 => 1,
            DataType::Integer16 | DataType::Unsigned16 => 2,
            DataType::Integer32 | DataType::Unsigned32 | DataType::Real32 => 4,
            DataType::TimeOfDay => 6,
            DataType::Integer64 | DataType::Unsigned64 => 8,
            DataType::VisibleString | DataType::OctetString | DataType::Domain => return None,
        })
    }

    /// The index of the type's own entry in the object dictionary, as it also
    /// stands in electronic data sheets.
    pub const fn code(self) -> u16 {
        match self {
            DataType::Boolean => 0x01,
            DataType::Integer8 => 0x02,
            DataType::Integer16 => 0x03,
            DataType::Integer32 => 0x04,
            DataType::Unsigned8 => 0x05,
            DataType::Unsigned16 => 0x06,
            DataType::Unsigned32 => 0x07,
            DataType::Real32 => 0x08,
            DataType::VisibleString => 0x09,
            DataType::OctetString => 0x0A,
            DataType::TimeOfDay => 0x0C,
            DataType::Domain => 0x0F,
            DataType::Integer64 => 0x15,
            DataType::Unsigned64 => 0x1B,
        }
    }

    const fn is_signed(self) -> bool {
        matches!(
            self,
            DataType::Integer8 | DataType::Integer16 | DataType::Integer32 | DataType::Integer64
        )
    }
}

/// A value of a type with a fixed size, up to eight bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Value {
    len: u8,
    signed: bool,
    bytes: [u8; VALUE_MAX],
}

impl Value {
    /// Reads a value of `data_type` from exactly its bytes.
    ///
    /// # Errors
    /// 06070012h or 06070013h if there are more or fewer bytes than the type
    /// has; 06070010h if the type has no fixed size.
    pub fn from_bytes(data_type: DataType, data: &[u8]) -> Result<Value, AbortCode> {
        let size = data_type.size().ok_or(AbortCode::LENGTH_MISMATCH)?;
        if data.len() > size {
            return Err(AbortCode::TOO_LONG);
        }
        if data.len() < size {
            return Err(AbortCode::TOO_SHORT);
        }
        let mut bytes = [0; VALUE_MAX];
        if let Some(space) = bytes.get_mut(..size) {
            space.copy_from_slice(data);
        }
        Ok(Value {
            len: size as u8,
            signed: data_type.is_signed(),
            bytes,
        })
    }

    /// `number` as `data_type`, its high bytes cut off. Strings and domains
    /// yield an empty value.
    pub fn new(data_type: DataType, number: i64) -> Value {
        let size = data_type.size().unwrap_or(0);
        let mut bytes = number.to_le_bytes();
        if let Some(cut_off) = bytes.get_mut(size..) {
            cut_off.fill(0);
        }
        Value {
            len: size as u8,
            signed: data_type.is_signed(),
            bytes,
        }
    }

    /// How many bytes it has.
    pub const fn len(&self) -> u8 {
        self.len
    }

    /// Of no bytes, as of strings and domains.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The bytes, little-endian.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// The bytes with zeros after them.
    pub const fn padded(&self) -> [u8; VALUE_MAX] {
        self.bytes
    }

    /// The number with its sign. Unsigned 64-bit numbers above [`i64::MAX`]
    /// saturate.
    pub const fn as_i64(&self) -> i64 {
        let raw = u64::from_le_bytes(self.bytes);
        if self.signed && self.len > 0 {
            let shift = 64 - 8 * self.len as u32;
            ((raw << shift) as i64) >> shift
        } else if raw > i64::MAX as u64 {
            i64::MAX
        } else {
            raw as i64
        }
    }

    /// The low 32 bits of the number, sign extended: what an object of at most
    /// four bytes holds.
    pub const fn as_i32(&self) -> i32 {
        self.as_u32() as i32
    }

    /// The low 32 bits of the number.
    pub const fn as_u32(&self) -> u32 {
        let [a, b, c, d, ..] = self.bytes;
        let raw = u32::from_le_bytes([a, b, c, d]);
        if self.signed && self.len > 0 && self.len < 4 {
            let shift = u32::BITS - 8 * self.len as u32;
            ((raw << shift) as i32 >> shift) as u32
        } else {
            raw
        }
    }

    /// The low 16 bits of the number.
    pub const fn as_u16(&self) -> u16 {
        self.as_u32() as u16
    }

    /// The low 8 bits of the number.
    pub const fn as_u8(&self) -> u8 {
        self.as_u32() as u8
    }
}

macro_rules! from_number {
    ($($number:ty: $signed:literal),*) => {
        $(impl From<$number> for Value {
            fn from(number: $number) -> Value {
                let le = number.to_le_bytes();
                let mut bytes = [0; VALUE_MAX];
                for (to, from) in bytes.iter_mut().zip(le) {
                    *to = from;
                }
                Value { len: le.len() as u8, signed: $signed, bytes }
            }
        })*
    };
}

from_number!(u8: false, u16: false, u32: false, u64: false, i8: true, i16: true, i32: true, i64: true);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NUMBERS: [DataType; 10] = [
        DataType::Boolean,
        DataType::Integer8,
        DataType::Integer16,
        DataType::Integer32,
        DataType::Integer64,
        DataType::Unsigned8,
        DataType::Unsigned16,
        DataType::Unsigned32,
        DataType::Unsigned64,
        DataType::Real32,
    ];

    proptest! {
        #[test]
        fn only_exactly_the_size_of_the_type_is_accepted(
            which in 0..NUMBERS.len(), data: Vec<u8>
        ) {
            let data_type = NUMBERS[which];
            let size = data_type.size().unwrap();
            match Value::from_bytes(data_type, &data) {
                Ok(value) => prop_assert_eq!(value.bytes(), &data[..]),
                Err(AbortCode::TOO_LONG) => prop_assert!(data.len() > size),
                Err(code) => {
                    prop_assert_eq!(code, AbortCode::TOO_SHORT);
                    prop_assert!(data.len() < size);
                }
            }
        }

        #[test]
        fn numbers_keep_their_sign(a: i8, b: i16, c: i32, d: i64, e: u32) {
            prop_assert_eq!(Value::from(a).as_i64(), i64::from(a));
            prop_assert_eq!(Value::from(b).as_i64(), i64::from(b));
            prop_assert_eq!(Value::from(c).as_i64(), i64::from(c));
            prop_assert_eq!(Value::from(d).as_i64(), d);
            prop_assert_eq!(Value::from(e).as_i64(), i64::from(e));
            prop_assert_eq!(Value::new(DataType::Integer16, i64::from(b)), Value::from(b));
        }
    }

    use std::vec::Vec;

    #[test]
    fn a_number_above_63_bits_saturates() {
        assert_eq!(Value::from(u64::MAX).as_i64(), i64::MAX);
    }

    #[test]
    fn strings_have_no_fixed_size() {
        assert_eq!(
            Value::from_bytes(DataType::VisibleString, b"x"),
            Err(AbortCode::LENGTH_MISMATCH)
        );
        assert_eq!(Value::new(DataType::Domain, 5).bytes(), &[] as &[u8]);
    }
}
