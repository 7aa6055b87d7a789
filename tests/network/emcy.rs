//! Emergency messages on the wire (CiA 301, 7.2.7).

use canmaster::emcy::{Emcy, EmcyCode, ErrorRegister};
use canmaster::{CobId, Frame, NodeId};
use proptest::prelude::*;

#[test]
fn an_emergency_on_the_wire() {
    let node = NodeId::constant::<6>();
    let emcy = Emcy {
        code: EmcyCode::HEARTBEAT,
        register: ErrorRegister::GENERIC.union(ErrorRegister::COMMUNICATION),
        manufacturer: [1, 2, 3, 4, 5],
    };
    let frame = Frame::full(
        CobId::new(0x086).unwrap(),
        [0x30, 0x81, 0x11, 1, 2, 3, 4, 5],
    );
    assert_eq!(emcy.frame(node), frame);
    assert_eq!(Emcy::decode(&frame), Some((node, emcy)));
    assert_eq!(emcy.register.to_string(), "generic, communication");
    assert_eq!(ErrorRegister(0).to_string(), "no error");
}

#[test]
fn a_sync_is_no_emergency() {
    assert_eq!(Emcy::decode(&Frame::full(CobId::SYNC, [0; 8])), None);
    let other = CobId::new(0x186).unwrap();
    assert_eq!(Emcy::decode(&Frame::full(other, [0; 8])), None);
}

proptest! {
    #[test]
    fn any_length_is_taken(node in 1u8..=127, data in prop::collection::vec(any::<u8>(), 0..=8)) {
        let frame = Frame::data_frame(CobId::new(0x80 + u16::from(node)).unwrap(), &data).unwrap();
        match Emcy::decode(&frame) {
            None => prop_assert!(data.len() < 2),
            Some((from, emcy)) => {
                prop_assert_eq!(from.get(), node);
                prop_assert_eq!(emcy.encode(), frame.padded());
            }
        }
    }
}
