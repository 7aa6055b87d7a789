//! A small object dictionary and shorthands for the tests of the SDO services.

use canmaster::id::{Address, CobId};
use canmaster::od::{
    Chunk, DataType, Entry, Object, ObjectDictionary, Part, Table, Value, Values, read_bytes,
};
use canmaster::sdo::{AbortCode, Payload};
use canmaster::time::{Duration, Instant};
use canmaster::{Frame, NodeId};

pub(crate) const NODE: NodeId = NodeId::constant::<5>();
pub(crate) const TIMEOUT: Duration = Duration::from_millis(500);

const OBJECTS: &[Object] = &[
    Object::constant(0x1000, 0, DataType::Unsigned32, 0x0002_0192),
    Object::string(0x1008, 0, "EPOS4"),
    Object::string(0x1009, 0, ""),
    Object::rw(0x1017, 0, DataType::Unsigned16, 0),
    Object::constant(0x1018, 0, DataType::Unsigned8, 4),
    Object::constant(0x1018, 1, DataType::Unsigned32, 0xFB),
    Object::rw(0x1F22, 1, DataType::Domain, 0),
    Object::wo(0x2000, 0, DataType::Unsigned8),
    Object::rw(0x2100, 0, DataType::Unsigned64, 0x0807_0605_0403_0201),
    Object::rw(0x6060, 0, DataType::Integer8, 1).limited(-4, 10),
];

/// 1F22h:01 is a domain that keeps what is written, the rest are numbers.
pub(crate) struct Dictionary {
    pub(crate) values: Values<{ OBJECTS.len() }>,
    pub(crate) domain: Vec<u8>,
    pub(crate) incoming: Vec<u8>,
    pub(crate) cancelled: u32,
}

pub(crate) const DOMAIN: Address = Address::new(0x1F22, 1);

impl Dictionary {
    pub(crate) fn new() -> Dictionary {
        Dictionary {
            values: Values::new(Table::new(OBJECTS)),
            domain: Vec::new(),
            incoming: Vec::new(),
            cancelled: 0,
        }
    }
}

impl ObjectDictionary for Dictionary {
    fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        self.values.entry(at)
    }

    fn get(&mut self, at: Address) -> Result<Value, AbortCode> {
        self.values.get(at)
    }

    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        self.values.set(at, value)
    }

    fn read(&mut self, at: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        if at == DOMAIN {
            Ok(read_bytes(&self.domain, offset, buf))
        } else {
            self.values.read(at, offset, buf)
        }
    }

    fn write(&mut self, _: Address, part: Part<'_>) -> Result<(), AbortCode> {
        if part.offset == 0 {
            self.incoming.clear();
        }
        assert_eq!(part.offset as usize, self.incoming.len());
        self.incoming.extend_from_slice(part.data);
        if part.last {
            self.domain = std::mem::take(&mut self.incoming);
        }
        Ok(())
    }

    fn cancel(&mut self, at: Address) {
        assert_eq!(at, DOMAIN);
        self.cancelled += 1;
        self.incoming.clear();
    }
}

pub(crate) fn request(bytes: [u8; 8]) -> Frame {
    Frame::full(CobId::new(0x605).unwrap(), bytes)
}

pub(crate) fn response(bytes: [u8; 8]) -> Frame {
    Frame::full(CobId::new(0x585).unwrap(), bytes)
}

pub(crate) fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

/// Data as the caller holds it.
#[derive(Default)]
pub(crate) struct Memory {
    pub(crate) data: Vec<u8>,
    pub(crate) limit: Option<u32>,
}

impl Memory {
    pub(crate) fn of(data: &[u8]) -> Memory {
        Memory {
            data: data.to_vec(),
            limit: None,
        }
    }
}

impl Payload for Memory {
    fn read(&mut self, offset: u32, buf: &mut [u8]) {
        let from = offset as usize;
        buf.copy_from_slice(&self.data[from..from + buf.len()]);
    }

    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        self.data.clear();
        match (size, self.limit) {
            (Some(size), Some(limit)) if size > limit => Err(AbortCode::OUT_OF_MEMORY),
            _ => Ok(()),
        }
    }

    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        assert_eq!(offset as usize, self.data.len());
        self.data.extend_from_slice(data);
        Ok(())
    }
}
