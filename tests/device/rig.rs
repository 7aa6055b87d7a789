//! A device on the bench: a client's frames go in, answers come out.

use canmaster::boot::Event as Step;
use canmaster::device::{Board, Description, Device, Event, Identity};
use canmaster::id::Address;
use canmaster::network::sample::SIX_EPOS4_10_MS as SIX_EPOS4;
use canmaster::nmt::{NodeControl, State};
use canmaster::od::{Chunk, Part, read_bytes};
use canmaster::sdo::AbortCode;
use canmaster::sync::SyncLimits;
use canmaster::time::{Duration, Instant};
use canmaster::{CobId, Frame, NodeId};

pub(crate) const DESCRIPTION: Description = Description {
    device_type: 0,
    name: "canmaster",
    hardware: "NUCLEO-G474RE",
    software: "0.1.0",
    identity: Identity {
        vendor: 0,
        product: 0x474,
        revision: 0x0001_0000,
        serial: 0x1234_5678,
    },
    sync: SyncLimits {
        shortest_period: 1000,
        longest_period: 65_535,
        shortest_window: 300,
    },
    tpdo_every: 8,
};

pub(crate) fn node(id: u8) -> NodeId {
    NodeId::new(id).unwrap()
}

pub(crate) fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

/// What the device has asked of its board.
#[derive(Default)]
pub(crate) struct Fake {
    pub(crate) saved: Option<Vec<u8>>,
    pub(crate) refuses: Option<AbortCode>,
    pub(crate) refuses_requests: Option<AbortCode>,
    pub(crate) can_save: bool,
}

impl Board for Fake {
    fn save(&mut self, settings: &[u8]) -> Result<(), AbortCode> {
        match self.refuses {
            Some(code) => Err(code),
            None => {
                self.saved = Some(settings.to_vec());
                Ok(())
            }
        }
    }

    fn can_save(&self) -> bool {
        self.can_save
    }

    fn may_request(&mut self, _: NodeControl) -> Result<(), AbortCode> {
        self.refuses_requests.map_or(Ok(()), Err)
    }

    fn read(&mut self, _: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        Ok(read_bytes(b"program", offset, buf))
    }

    fn write(&mut self, _: Address, _: Part<'_>) -> Result<(), AbortCode> {
        Err(AbortCode::TOO_LONG)
    }

    fn tpdo(&mut self, node: NodeId, number: u8) -> [u8; 8] {
        [node.get(), number, 0x11, 0x12, 0x13, 0x14, 0x15, 0x16]
    }

    fn rpdo(&mut self, node: NodeId, number: u8) -> [u8; 8] {
        [node.get(), number, 0x21, 0x22, 0x23, 0x24, 0x25, 0x26]
    }
}

pub(crate) struct Bench {
    pub(crate) device: Device<6>,
    pub(crate) board: Fake,
    pub(crate) now: Instant,
}

impl Bench {
    /// In pre-operational.
    pub(crate) fn new() -> Bench {
        let timeout = Duration::from_millis(500);
        let mut bench = Bench {
            device: Device::new(DESCRIPTION, &SIX_EPOS4, timeout),
            board: Fake {
                can_save: true,
                ..Fake::default()
            },
            now: ms(0),
        };
        bench.enter(State::PreOperational);
        bench
    }

    pub(crate) fn enter(&mut self, state: State) {
        self.device.set_state(state, &mut self.board, self.now);
    }

    pub(crate) fn boot(&mut self, step: Step) {
        self.device.on_boot_event(&step);
    }

    pub(crate) fn frame(&mut self, frame: &Frame) -> Option<Frame> {
        self.device.on_frame(frame, self.now, &mut self.board)
    }

    pub(crate) fn poll(&mut self) -> Option<Frame> {
        self.device.poll(self.now, &mut self.board)
    }

    pub(crate) fn ask(&mut self, bytes: [u8; 8]) -> Option<[u8; 8]> {
        let request = Frame::full(CobId::new(0x67F).unwrap(), bytes);
        self.frame(&request).map(|answer| {
            assert_eq!(answer.id(), CobId::new(0x5FF).unwrap());
            assert_eq!(answer.dlc(), 8);
            answer.padded()
        })
    }

    pub(crate) fn expect(&mut self, bytes: [u8; 8], answer: [u8; 8]) {
        assert_eq!(self.ask(bytes), Some(answer), "to {bytes:02X?}");
    }

    /// Reads an entry, in as many segments as it takes.
    pub(crate) fn read(&mut self, index: u16, sub: u8) -> Result<Vec<u8>, AbortCode> {
        let [low, high] = index.to_le_bytes();
        let first = self.ask([0x40, low, high, sub, 0, 0, 0, 0]).unwrap();
        assert_eq!(first[1..4], [low, high, sub]);
        match first[0] {
            0x43 | 0x47 | 0x4B | 0x4F => {
                let unused = usize::from(first[0] >> 2 & 3);
                Ok(first[4..8 - unused].to_vec())
            }
            0x41 => {
                let size = u32::from_le_bytes(first[4..].try_into().unwrap());
                let mut data = Vec::new();
                let mut toggle = 0;
                loop {
                    let segment = self.ask([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]).unwrap();
                    assert_eq!(segment[0] & 0xF0, toggle);
                    let unused = usize::from(segment[0] >> 1 & 7);
                    data.extend_from_slice(&segment[1..8 - unused]);
                    toggle ^= 0x10;
                    if segment[0] & 1 != 0 {
                        break;
                    }
                }
                assert_eq!(data.len(), size as usize);
                Ok(data)
            }
            0x80 => Err(abort_code(first)),
            other => panic!("answer {other:02X}"),
        }
    }

    pub(crate) fn number(&mut self, index: u16, sub: u8) -> Result<u64, AbortCode> {
        self.read(index, sub).map(|data| {
            let mut bytes = [0; 8];
            bytes[..data.len()].copy_from_slice(&data);
            u64::from_le_bytes(bytes)
        })
    }

    pub(crate) fn text(&mut self, index: u16, sub: u8) -> String {
        String::from_utf8(self.read(index, sub).unwrap()).unwrap()
    }

    /// Writes an entry of up to seven bytes.
    pub(crate) fn write(&mut self, index: u16, sub: u8, data: &[u8]) -> Result<(), AbortCode> {
        let [low, high] = index.to_le_bytes();
        let mut request = [0x21, low, high, sub, 0, 0, 0, 0];
        if data.len() <= 4 {
            request[0] = 0x23 | ((4 - data.len() as u8) << 2);
            request[4..4 + data.len()].copy_from_slice(data);
        } else {
            request[4] = data.len() as u8;
        }
        let mut answer = self.ask(request).unwrap();
        if data.len() > 4 && answer[0] == 0x60 {
            let mut segment = [1 | (7 - data.len() as u8) << 1, 0, 0, 0, 0, 0, 0, 0];
            segment[1..=data.len()].copy_from_slice(data);
            answer = self.ask(segment).unwrap();
            if answer[0] == 0x20 {
                return Ok(());
            }
        }
        match answer[0] {
            0x60 => {
                assert_eq!(answer, [0x60, low, high, sub, 0, 0, 0, 0]);
                Ok(())
            }
            _ => Err(abort_code(answer)),
        }
    }

    pub(crate) fn write_u8(&mut self, index: u16, sub: u8, value: u8) -> Result<(), AbortCode> {
        self.write(index, sub, &[value])
    }

    pub(crate) fn write_u16(&mut self, index: u16, sub: u8, value: u16) -> Result<(), AbortCode> {
        self.write(index, sub, &value.to_le_bytes())
    }

    pub(crate) fn write_u32(&mut self, index: u16, sub: u8, value: u32) -> Result<(), AbortCode> {
        self.write(index, sub, &value.to_le_bytes())
    }

    pub(crate) fn events(&mut self) -> Vec<Event> {
        std::iter::from_fn(|| self.device.take_event()).collect()
    }
}

fn abort_code(answer: [u8; 8]) -> AbortCode {
    assert_eq!(answer[0], 0x80);
    AbortCode(u32::from_le_bytes(answer[4..].try_into().unwrap()))
}
