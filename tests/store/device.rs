//! 1010h, 1011h and the power switch: from the SDO request to the next start.

use crate::flash::{Flash, Torn};
use crate::open;
use canmaster::device::{Board, Description, Device, Identity};
use canmaster::network::sample::SIX_EPOS4;
use canmaster::nmt::{NodeControl, State};
use canmaster::sdo::AbortCode;
use canmaster::store::{CAPACITY, Store};
use canmaster::sync::SyncLimits;
use canmaster::{CobId, Duration, Frame, Instant, NodeId};

const DESCRIPTION: Description = Description {
    device_type: 0,
    name: "canmaster",
    hardware: "",
    software: "",
    identity: Identity {
        vendor: 0,
        product: 0,
        revision: 0,
        serial: 0,
    },
    sync: SyncLimits {
        shortest_period: 1000,
        longest_period: 65_535,
        shortest_window: 300,
    },
    tpdo_every: 8,
};

struct WithFlash(Store<Flash>);

impl Board for WithFlash {
    fn save(&mut self, settings: &[u8]) -> Result<(), AbortCode> {
        Ok(self.0.save(settings)?)
    }

    fn can_save(&self) -> bool {
        true
    }

    fn may_request(&mut self, _: NodeControl) -> Result<(), AbortCode> {
        Ok(())
    }

    fn tpdo(&mut self, _: NodeId, _: u8) -> [u8; 8] {
        [0; 8]
    }

    fn rpdo(&mut self, _: NodeId, _: u8) -> [u8; 8] {
        [0; 8]
    }
}

struct Powered {
    device: Device<6>,
    board: WithFlash,
}

impl Powered {
    fn on(flash: Flash) -> Powered {
        let mut board = WithFlash(open(flash));
        let timeout = Duration::from_millis(500);
        let mut device = Device::new(DESCRIPTION, &SIX_EPOS4, timeout);
        let mut buf = [0; CAPACITY];
        if let Some(saved) = board.0.load(&mut buf).unwrap() {
            device.load(saved, Instant::ZERO);
        }
        device.set_state(State::PreOperational, &mut board, Instant::ZERO);
        Powered { device, board }
    }

    fn off(self) -> Flash {
        self.board.0.release().power_on()
    }

    fn ask(&mut self, bytes: &[u8; 8]) -> u8 {
        let frame = Frame::full(CobId::new(0x67F).unwrap(), *bytes);
        let board = &mut self.board;
        let answer = self.device.on_frame(&frame, Instant::ZERO, board);
        self.device.take_event();
        answer.unwrap().padded()[0]
    }

    fn heartbeat(&self) -> u32 {
        self.device.settings().heartbeat().as_millis()
    }
}

#[test]
fn what_was_saved_is_there_at_the_next_start() {
    let mut board = Powered::on(Flash::new(1));
    assert_eq!(board.ask(b"\x2B\x17\x10\x00\x64\0\0\0"), 0x60);
    // Not saved: gone.
    board = Powered::on(board.off());
    assert_eq!(board.heartbeat(), 50);
    assert_eq!(board.ask(b"\x2B\x17\x10\x00\x64\0\0\0"), 0x60);
    assert_eq!(board.ask(b"\x23\x10\x10\x01save"), 0x60);
    board = Powered::on(board.off());
    assert_eq!(board.heartbeat(), 100);
    assert_eq!(board.ask(b"\x23\x11\x10\x01load"), 0x60);
    board = Powered::on(board.off());
    assert_eq!(board.heartbeat(), 50);
}

#[test]
fn a_power_cut_while_saving_is_told_and_leaves_the_old_or_the_new() {
    for torn in Torn::ALL {
        for cut in 0.. {
            let mut board = Powered::on(Flash::new(7));
            assert_eq!(board.ask(b"\x2B\x17\x10\x00\x64\0\0\0"), 0x60);
            assert_eq!(board.ask(b"\x23\x10\x10\x01save"), 0x60);
            let mut board = Powered::on(board.off().cut_after(cut, torn));
            assert_eq!(board.ask(b"\x2B\x17\x10\x00\xC8\0\0\0"), 0x60);
            let told = board.ask(b"\x23\x10\x10\x01save");
            let found = Powered::on(board.off()).heartbeat();
            if told == 0x60 {
                assert_eq!(found, 200);
                assert!(cut > 10);
                break;
            }
            assert_eq!(told, 0x80);
            assert!(found == 100 || found == 200, "{found}");
        }
    }
}
