//! Communication and mapping parameters of one PDO as a node holds them
//! (CiA 301, 7.5.2.35 .. 7.5.2.38).

use super::cob_id::PdoCobId;
use super::mapping::{MAPPING_MAX, Mapping, MappingEntry};
use super::transmission::Transmission;
use super::{Direction, PDO_MAX};
use crate::od::{Access, DataType, Entry, Value};
use crate::sdo::AbortCode;

/// What a device offers of the standard's choices. Devices differ in this.
#[derive(Clone, Copy, Debug)]
pub struct Features {
    /// Sub-index 0 of the communication parameter: its highest sub-index.
    pub highest_sub: u8,
    /// How many objects can be mapped, at most [`MAPPING_MAX`].
    pub entries: u8,
    /// The transmission types that are accepted, of those that exist.
    pub transmission: fn(Transmission) -> bool,
    /// Whether the mapping can be changed only while the PDO is switched off,
    /// as the standard wants it. Real drives were seen not to insist.
    pub mapping_needs_invalid: bool,
}

/// The parameters of one PDO, written and read as an SDO client would.
///
/// Refusing writes in the wrong NMT state (08000022h) is left to the device.
#[derive(Clone, Debug)]
pub struct Configuration {
    direction: Direction,
    features: Features,
    cob_id: PdoCobId,
    transmission: u8,
    inhibit_time: u16,
    event_timer: u16,
    sync_start: u8,
    /// Sub-index 0 of the mapping.
    count: u8,
    entries: [MappingEntry; MAPPING_MAX],
    /// What `count` and `entries` amount to.
    mapping: Mapping,
}

/// Sub-indices of a communication parameter.
mod sub {
    pub(super) const HIGHEST: u8 = 0;
    pub(super) const COB_ID: u8 = 1;
    pub(super) const TRANSMISSION: u8 = 2;
    pub(super) const INHIBIT_TIME: u8 = 3;
    // 4 is reserved: 06090011h.
    pub(super) const EVENT_TIMER: u8 = 5;
    pub(super) const SYNC_START: u8 = 6;
}

impl Configuration {
    /// A PDO as the device has it after a reset.
    pub fn new(
        direction: Direction,
        features: Features,
        cob_id: PdoCobId,
        transmission: Transmission,
        mapping: Mapping,
    ) -> Configuration {
        let mut entries = [MappingEntry(0); MAPPING_MAX];
        for (to, from) in entries.iter_mut().zip(mapping.entries()) {
            *to = *from;
        }
        Configuration {
            direction,
            features,
            cob_id,
            transmission: transmission.code(),
            inhibit_time: 0,
            event_timer: 0,
            sync_start: 0,
            count: mapping.entries().len() as u8,
            entries,
            mapping,
        }
    }

    /// The same with an inhibit time in units of 100 us.
    pub const fn with_inhibit_time(self, inhibit_time: u16) -> Configuration {
        Configuration {
            inhibit_time,
            ..self
        }
    }

    /// The COB-ID word.
    pub const fn cob_id(&self) -> PdoCobId {
        self.cob_id
    }

    /// Whether the PDO exists.
    pub const fn is_valid(&self) -> bool {
        self.cob_id.is_valid()
    }

    /// The transmission type.
    pub const fn transmission(&self) -> Transmission {
        Transmission::from_code(self.transmission)
    }

    /// The objects carried: none while sub-index 0 is 0.
    pub const fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// The least time between two transmissions, in units of 100 us.
    pub const fn inhibit_time(&self) -> u16 {
        self.inhibit_time
    }

    /// The longest time between two transmissions, or the deadline of an RPDO,
    /// in milliseconds; 0: none.
    pub const fn event_timer(&self) -> u16 {
        self.event_timer
    }

    /// The SYNC counter at which a TPDO starts to count; 0: any.
    pub const fn sync_start(&self) -> u8 {
        self.sync_start
    }

    /// Type and access of an entry of the communication parameter.
    ///
    /// # Errors
    /// 06090011h if there is none.
    pub const fn communication_entry(&self, sub: u8) -> Result<Entry, AbortCode> {
        if sub > self.features.highest_sub {
            return Err(AbortCode::NO_SUCH_SUB_INDEX);
        }
        let (data_type, access) = match sub {
            sub::HIGHEST => (DataType::Unsigned8, Access::Constant),
            sub::COB_ID => (DataType::Unsigned32, Access::ReadWrite),
            sub::TRANSMISSION => (DataType::Unsigned8, Access::ReadWrite),
            sub::INHIBIT_TIME | sub::EVENT_TIMER => (DataType::Unsigned16, Access::ReadWrite),
            sub::SYNC_START => (DataType::Unsigned8, Access::ReadWrite),
            _ => return Err(AbortCode::NO_SUCH_SUB_INDEX),
        };
        Ok(Entry::new(data_type, access))
    }

    /// Reads an entry of the communication parameter.
    ///
    /// # Errors
    /// 06090011h if there is none.
    pub fn read_communication(&self, sub: u8) -> Result<Value, AbortCode> {
        self.communication_entry(sub)?;
        Ok(match sub {
            sub::HIGHEST => Value::from(self.features.highest_sub),
            sub::COB_ID => Value::from(self.cob_id.0),
            sub::TRANSMISSION => Value::from(self.transmission),
            sub::INHIBIT_TIME => Value::from(self.inhibit_time),
            sub::EVENT_TIMER => Value::from(self.event_timer),
            sub::SYNC_START => Value::from(self.sync_start),
            _ => return Err(AbortCode::NO_SUCH_SUB_INDEX),
        })
    }

    /// Writes an entry of the communication parameter.
    ///
    /// # Errors
    /// 06090011h, 06010002h, 06090030h as the entry wants it; 06010000h for
    /// what may be changed only while the PDO is switched off.
    pub fn write_communication(&mut self, sub: u8, value: Value) -> Result<(), AbortCode> {
        self.communication_entry(sub)?.writable()?;
        match sub {
            sub::COB_ID => {
                let new = PdoCobId(value.as_u32());
                new.may_replace(self.cob_id)?;
                self.cob_id = new;
            }
            sub::TRANSMISSION => {
                let new = Transmission::from_code(value.as_u8());
                if !new.exists(self.direction) || !(self.features.transmission)(new) {
                    return Err(AbortCode::VALUE_RANGE);
                }
                self.transmission = new.code();
            }
            sub::INHIBIT_TIME => {
                self.only_while_invalid()?;
                self.inhibit_time = value.as_u16();
            }
            sub::EVENT_TIMER => self.event_timer = value.as_u16(),
            sub::SYNC_START => {
                self.only_while_invalid()?;
                self.sync_start = value.as_u8();
            }
            _ => return Err(AbortCode::NO_SUCH_SUB_INDEX),
        }
        Ok(())
    }

    /// Type and access of an entry of the mapping parameter.
    ///
    /// # Errors
    /// 06090011h if there is none.
    pub const fn mapping_entry(&self, sub: u8) -> Result<Entry, AbortCode> {
        if sub > self.features.entries || sub as usize > MAPPING_MAX {
            return Err(AbortCode::NO_SUCH_SUB_INDEX);
        }
        let data_type = if sub == sub::HIGHEST {
            DataType::Unsigned8
        } else {
            DataType::Unsigned32
        };
        Ok(Entry::new(data_type, Access::ReadWrite))
    }

    /// Reads an entry of the mapping parameter.
    ///
    /// # Errors
    /// 06090011h if there is none.
    pub fn read_mapping(&self, sub: u8) -> Result<Value, AbortCode> {
        self.mapping_entry(sub)?;
        match sub.checked_sub(1) {
            None => Ok(Value::from(self.count)),
            Some(position) => {
                let entry = self.entries.get(usize::from(position));
                let entry = entry.ok_or(AbortCode::NO_SUCH_SUB_INDEX)?;
                Ok(Value::from(entry.0))
            }
        }
    }

    /// Writes an entry of the mapping parameter. `describe` looks the mapped
    /// objects up in the object dictionary.
    ///
    /// # Errors
    /// 06010003h for an entry while sub-index 0 is not 0; 06040041h for an
    /// object that cannot be mapped; 06040042h for more than 64 bits or more
    /// entries than there are; what `describe` answers for objects that do not
    /// exist; 06010000h while the PDO must be switched off first.
    pub fn write_mapping(
        &mut self,
        sub: u8,
        value: Value,
        describe: impl Fn(MappingEntry) -> Result<Entry, AbortCode>,
    ) -> Result<(), AbortCode> {
        self.mapping_entry(sub)?;
        if self.features.mapping_needs_invalid {
            self.only_while_invalid()?;
        }
        match sub.checked_sub(1) {
            None => self.write_count(value.as_u8(), describe),
            Some(position) => {
                if self.count != 0 {
                    return Err(AbortCode::SUB0_NOT_ZERO);
                }
                let entry = MappingEntry(value.as_u32());
                // An empty entry clears the place.
                if entry.0 != 0 {
                    entry.check(&describe(entry)?, self.direction)?;
                }
                let slot = self.entries.get_mut(usize::from(position));
                *slot.ok_or(AbortCode::NO_SUCH_SUB_INDEX)? = entry;
                Ok(())
            }
        }
    }

    fn write_count(
        &mut self,
        count: u8,
        describe: impl Fn(MappingEntry) -> Result<Entry, AbortCode>,
    ) -> Result<(), AbortCode> {
        if count > self.features.entries {
            return Err(AbortCode::PDO_LENGTH);
        }
        let entries = self
            .entries
            .get(..usize::from(count))
            .ok_or(AbortCode::PDO_LENGTH)?;
        for &entry in entries {
            entry.check(&describe(entry)?, self.direction)?;
        }
        let mapping = Mapping::new(entries).ok_or(AbortCode::PDO_LENGTH)?;
        self.count = count;
        self.mapping = mapping;
        Ok(())
    }

    /// How many bytes a received PDO must have at least.
    pub fn bytes(&self) -> usize {
        self.mapping.bytes().min(PDO_MAX)
    }

    fn only_while_invalid(&self) -> Result<(), AbortCode> {
        if self.is_valid() {
            Err(AbortCode::UNSUPPORTED_ACCESS)
        } else {
            Ok(())
        }
    }
}
