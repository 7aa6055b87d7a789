//! A dictionary made of a constant, sorted list of objects.

use super::entry::{Access, Entry, Mappable};
use super::value::{DataType, Value};
use super::{Chunk, ObjectDictionary, read_bytes};
use crate::id::Address;
use crate::sdo::AbortCode;

/// One entry of a [`Table`]: what it is and what it holds after a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Index and sub-index.
    pub at: Address,
    /// Type, access, mappability, range.
    pub entry: Entry,
    /// The value after a reset, for types of fixed size.
    pub default: i64,
    /// The content of a constant string.
    pub text: &'static str,
}

impl Object {
    const fn with(
        index: u16,
        sub: u8,
        data_type: DataType,
        access: Access,
        default: i64,
    ) -> Object {
        Object {
            at: Address::new(index, sub),
            entry: Entry::new(data_type, access),
            default,
            text: "",
        }
    }

    /// A number that can be read and written.
    pub const fn rw(index: u16, sub: u8, data_type: DataType, default: i64) -> Object {
        Object::with(index, sub, data_type, Access::ReadWrite, default)
    }

    /// A number that can only be read.
    pub const fn ro(index: u16, sub: u8, data_type: DataType, default: i64) -> Object {
        Object::with(index, sub, data_type, Access::ReadOnly, default)
    }

    /// A number that can only be written.
    pub const fn wo(index: u16, sub: u8, data_type: DataType) -> Object {
        Object::with(index, sub, data_type, Access::WriteOnly, 0)
    }

    /// A number that never changes: sub-index 0 of a record, identity.
    pub const fn constant(index: u16, sub: u8, data_type: DataType, value: i64) -> Object {
        Object::with(index, sub, data_type, Access::Constant, value)
    }

    /// A constant VISIBLE_STRING.
    pub const fn string(index: u16, sub: u8, text: &'static str) -> Object {
        let object = Object::with(index, sub, DataType::VisibleString, Access::Constant, 0);
        Object { text, ..object }
    }

    /// The same, mappable: into TPDOs if it can be read, into RPDOs if it can
    /// be written.
    pub const fn pdo(self) -> Object {
        let mappable = match self.entry.access {
            Access::ReadOnly | Access::Constant => Mappable::Tpdo,
            Access::WriteOnly => Mappable::Rpdo,
            Access::ReadWrite => Mappable::Both,
        };
        self.mappable(mappable)
    }

    /// The same, mappable as told.
    pub const fn mappable(self, mappable: Mappable) -> Object {
        Object {
            entry: self.entry.mappable(mappable),
            ..self
        }
    }

    /// The same, limited to `min..=max`.
    pub const fn limited(self, min: i64, max: i64) -> Object {
        Object {
            entry: self.entry.limited(min, max),
            ..self
        }
    }
}

/// A list of objects, ascending by index and sub-index.
#[derive(Clone, Copy, Debug)]
pub struct Table(&'static [Object]);

impl Table {
    /// Wraps a list that ascends by index and sub-index without doubles; a
    /// wrong list does not compile where this is evaluated in a constant.
    ///
    /// # Panics
    /// If the list does not ascend.
    pub const fn new(objects: &'static [Object]) -> Table {
        let mut rest = objects;
        while let [a, tail @ ..] = rest {
            if let [b, ..] = tail {
                assert!(
                    key(a.at) < key(b.at),
                    "the objects must ascend by index and sub-index"
                );
            }
            rest = tail;
        }
        Table(objects)
    }

    /// The objects.
    pub const fn objects(&self) -> &'static [Object] {
        self.0
    }

    /// The position of an entry.
    ///
    /// # Errors
    /// 06020000h if the object, 06090011h if the sub-index does not exist.
    pub fn position(&self, at: Address) -> Result<usize, AbortCode> {
        match self
            .0
            .binary_search_by_key(&key(at), |object| key(object.at))
        {
            Ok(position) => Ok(position),
            Err(next) => {
                // The object exists if a neighbour has the same index.
                let same = |object: Option<&Object>| object.is_some_and(|o| o.at.index == at.index);
                let before = next.checked_sub(1).and_then(|before| self.0.get(before));
                if same(before) || same(self.0.get(next)) {
                    Err(AbortCode::NO_SUCH_SUB_INDEX)
                } else {
                    Err(AbortCode::NO_SUCH_OBJECT)
                }
            }
        }
    }

    /// The description of an entry.
    ///
    /// # Errors
    /// As [`Table::position`].
    pub fn object(&self, at: Address) -> Result<&'static Object, AbortCode> {
        let position = self.position(at)?;
        self.0.get(position).ok_or(AbortCode::NO_SUCH_OBJECT)
    }
}

const fn key(at: Address) -> u32 {
    (at.index.0 as u32) << 8 | at.sub.0 as u32
}

/// The values of a [`Table`] of `N` objects: by itself a complete dictionary
/// without side effects, and the store behind one that has them.
#[derive(Clone, Debug)]
pub struct Values<const N: usize> {
    table: Table,
    values: [Value; N],
}

impl<const N: usize> Values<N> {
    /// All values at their defaults. `N` is `table.objects().len()`; entries
    /// past the shorter of the two do not exist.
    pub fn new(table: Table) -> Values<N> {
        let mut values = Values {
            table,
            values: [Value::new(DataType::Domain, 0); N],
        };
        values.reset();
        values
    }

    /// All values back to their defaults.
    pub fn reset(&mut self) {
        self.reset_range(0, u16::MAX);
    }

    /// The values of the indices `from..=to` back to their defaults: reset
    /// communication affects 1000h..=1FFFh only (CiA 301, 7.3.2.2.1).
    pub fn reset_range(&mut self, from: u16, to: u16) {
        for (value, object) in self.values.iter_mut().zip(self.table.0) {
            if (from..=to).contains(&object.at.index.0) {
                *value = Value::new(object.entry.data_type, object.default);
            }
        }
    }

    /// The table.
    pub const fn table(&self) -> Table {
        self.table
    }

    /// The value of an entry, whatever its access.
    ///
    /// # Errors
    /// As [`Table::position`].
    pub fn value(&self, at: Address) -> Result<Value, AbortCode> {
        let position = self.table.position(at)?;
        let value = self.values.get(position);
        value.copied().ok_or(AbortCode::NO_SUCH_OBJECT)
    }

    /// The value of an entry as a number, 0 if there is none: for a device that
    /// knows its own table.
    pub fn number(&self, index: u16, sub: u8) -> i64 {
        let value = self.value(Address::new(index, sub));
        value.map_or(0, |value| value.as_i64())
    }

    /// Sets an entry from within the device, whatever its access and range.
    /// `false` if it does not exist.
    pub fn put(&mut self, index: u16, sub: u8, number: i64) -> bool {
        let at = Address::new(index, sub);
        let Ok(position) = self.table.position(at) else {
            return false;
        };
        match (self.table.0.get(position), self.values.get_mut(position)) {
            (Some(object), Some(value)) => {
                *value = Value::new(object.entry.data_type, number);
                true
            }
            _ => false,
        }
    }
}

impl<const N: usize> ObjectDictionary for Values<N> {
    fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        Ok(self.table.object(at)?.entry)
    }

    fn get(&mut self, at: Address) -> Result<Value, AbortCode> {
        self.value(at)
    }

    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        let position = self.table.position(at)?;
        *self
            .values
            .get_mut(position)
            .ok_or(AbortCode::NO_SUCH_OBJECT)? = value;
        Ok(())
    }

    fn read(&mut self, at: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        let object = self.table.object(at)?;
        Ok(read_bytes(object.text.as_bytes(), offset, buf))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::od::{download, upload};
    use DataType::{Integer8, Unsigned8, Unsigned16, Unsigned32};

    const OBJECTS: &[Object] = &[
        Object::constant(0x1000, 0, Unsigned32, 0x0002_0192),
        Object::string(0x1008, 0, "EPOS4"),
        Object::rw(0x1017, 0, Unsigned16, 0),
        Object::constant(0x1018, 0, Unsigned8, 1),
        Object::constant(0x1018, 1, Unsigned32, 0xFB),
        Object::wo(0x1FF0, 0, Unsigned8),
        Object::rw(0x6060, 0, Integer8, 1).limited(-4, 10).pdo(),
    ];
    const TABLE: Table = Table::new(OBJECTS);

    fn values() -> Values<{ OBJECTS.len() }> {
        Values::new(TABLE)
    }

    #[test]
    fn a_missing_object_and_a_missing_sub_index_differ() {
        for (index, sub, code) in [
            (0x1018, 2, AbortCode::NO_SUCH_SUB_INDEX),
            (0x1008, 9, AbortCode::NO_SUCH_SUB_INDEX),
            (0x0FFF, 0, AbortCode::NO_SUCH_OBJECT),
            (0x1009, 0, AbortCode::NO_SUCH_OBJECT),
            (0xFFFF, 255, AbortCode::NO_SUCH_OBJECT),
        ] {
            assert_eq!(TABLE.position(Address::new(index, sub)), Err(code));
        }
    }

    #[test]
    fn access_length_and_range_are_checked() {
        let od = &mut values();
        let mode = Address::new(0x6060, 0);
        assert_eq!(download(od, mode, &[0xFD]), Ok(()));
        assert_eq!(upload(od, mode).unwrap().as_i32(), -3);
        for (index, data, code) in [
            (0x6060, &[11][..], AbortCode::VALUE_RANGE),
            (0x6060, &[0xFB], AbortCode::VALUE_RANGE),
            (0x6060, &[1, 0], AbortCode::TOO_LONG),
            (0x1017, &[1], AbortCode::TOO_SHORT),
            (0x1000, &[0; 4], AbortCode::READ_ONLY),
        ] {
            assert_eq!(download(od, Address::new(index, 0), data), Err(code));
        }
        assert_eq!(upload(od, mode).unwrap().as_i32(), -3);
        assert_eq!(
            upload(od, Address::new(0x1FF0, 0)),
            Err(AbortCode::WRITE_ONLY)
        );
    }

    #[test]
    fn a_reset_of_communication_leaves_the_profile_alone() {
        let od = &mut values();
        assert!(od.put(0x1017, 0, 50));
        assert!(od.put(0x6060, 0, 3));
        assert!(!od.put(0x6061, 0, 3));
        od.reset_range(0x1000, 0x1FFF);
        assert_eq!(od.number(0x1017, 0), 0);
        assert_eq!(od.number(0x6060, 0), 3);
        od.reset();
        assert_eq!(od.number(0x6060, 0), 1);
    }

    #[test]
    fn strings_are_read_in_pieces() {
        let od = &mut values();
        let at = Address::new(0x1008, 0);
        let mut buf = [0; 4];
        let first = od.read(at, 0, &mut buf).unwrap();
        assert_eq!((first.len, first.size, first.last), (4, Some(5), false));
        let second = od.read(at, 4, &mut buf).unwrap();
        assert_eq!((second.len, second.last), (1, true));
        assert_eq!(buf[0], b'4');
        assert_eq!(od.read(at, 99, &mut buf).unwrap().len, 0);
    }
}
