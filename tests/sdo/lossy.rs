//! Client and server over a wire that loses frames, and over one that makes
//! them up.

use crate::common::{DOMAIN, Dictionary, Memory, NODE, TIMEOUT, ms, response};
use canmaster::Frame;
use canmaster::id::Address;
use canmaster::sdo::{Channel, Progress, Protocol, SdoError, Server, Transfer};
use proptest::prelude::*;

fn bench() -> (Server, Dictionary) {
    (Server::new(NODE, TIMEOUT), Dictionary::new())
}

/// Lets client and server talk over a wire that loses what `lose` says, in
/// virtual time, until the transfer has ended.
fn converse(
    c: &mut Channel,
    m: &mut Memory,
    b: &mut (Server, Dictionary),
    first: Frame,
    mut lose: impl FnMut() -> bool,
) -> Result<u32, SdoError> {
    let mut now = ms(0);
    let mut to_server = vec![first];
    let mut to_client = vec![];
    for _ in 0..1_000_000 {
        let mut progress = Progress::Nothing;
        if !to_server.is_empty() {
            let frame = to_server.remove(0);
            if !lose() {
                to_client.extend(b.0.on_frame(&frame, now, &mut b.1));
            }
        } else if !to_client.is_empty() {
            let frame = to_client.remove(0);
            if !lose() {
                progress = c.on_frame(&frame, now, m);
            }
        } else {
            let next = [c.next_deadline(), b.0.next_deadline()];
            now = now.max(next.into_iter().flatten().min().expect("a deadline"));
            to_client.extend(b.0.poll(now, &mut b.1));
            progress = c.poll(now, m);
        }
        match progress {
            Progress::Nothing => {}
            Progress::Send(frame) => to_server.push(frame),
            Progress::Done(transfer) => {
                for frame in to_server {
                    b.0.on_frame(&frame, now, &mut b.1);
                }
                return Ok(transfer.len);
            }
            Progress::Failed(error, _) => return Err(error),
        }
    }
    panic!("no end");
}

fn data(len: usize) -> Vec<u8> {
    (0..len as u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect()
}

#[test]
fn a_hundred_kilobytes_both_ways_by_either_protocol() {
    for protocol in [Protocol::Normal, Protocol::Block] {
        let whole = data(100_000);
        let (mut c, mut m, mut b) = (Channel::new(NODE, TIMEOUT), Memory::of(&whole), bench());
        let first = c
            .download(DOMAIN, 100_000, protocol, &mut m, ms(0))
            .unwrap();
        assert_eq!(
            converse(&mut c, &mut m, &mut b, first, || false),
            Ok(100_000)
        );
        assert!(b.1.domain == whole);
        m.data.clear();
        let first = c.upload(DOMAIN, protocol, ms(0)).unwrap();
        assert_eq!(
            converse(&mut c, &mut m, &mut b, first, || false),
            Ok(100_000)
        );
        assert!(m.data == whole);
        assert!(b.0.is_idle());
    }
}

#[test]
fn a_number_by_block_transfer() {
    let (mut c, mut b) = (Channel::new(NODE, TIMEOUT), bench());
    let at = Address::new(0x1017, 0);
    let mut m = Memory::of(&[0x34, 0x12]);
    let first = c.download(at, 2, Protocol::Block, &mut m, ms(0)).unwrap();
    assert_eq!(converse(&mut c, &mut m, &mut b, first, || false), Ok(2));
    assert_eq!(b.1.values.number(0x1017, 0), 0x1234);
    let first = c.upload(at, Protocol::Block, ms(0)).unwrap();
    assert_eq!(converse(&mut c, &mut m, &mut b, first, || false), Ok(2));
    assert_eq!(m.data, [0x34, 0x12]);
}

proptest! {
    /// Whatever is lost, the data that arrives is the data that was sent, and
    /// the transfer ends.
    #[test]
    fn losses_never_corrupt(
        len in 0usize..3000, upload: bool, block: bool, block_size in 1u8..=127,
        lost in prop::collection::btree_set(0usize..600, 0..12)
    ) {
        let whole = data(len);
        let mut b = bench();
        b.0 = Server::new(NODE, TIMEOUT).with_block_size(block_size);
        let mut c = Channel::new(NODE, TIMEOUT);
        let mut m = Memory::of(&whole);
        let protocol = if block { Protocol::Block } else { Protocol::Normal };
        let first = if upload {
            b.1.domain = whole.clone();
            c.upload(DOMAIN, protocol, ms(0)).unwrap()
        } else {
            c.download(DOMAIN, len as u32, protocol, &mut m, ms(0)).unwrap()
        };
        let mut count = 0;
        let result = converse(&mut c, &mut m, &mut b, first, || {
            count += 1;
            lost.contains(&(count - 1))
        });
        match result {
            Ok(got) => {
                prop_assert_eq!(got as usize, len);
                let there = if upload { &m.data } else { &b.1.domain };
                prop_assert!(*there == whole);
            }
            Err(error) => {
                prop_assert!(!lost.is_empty(), "{}", error);
                prop_assert!(upload || b.1.domain.is_empty() || b.1.domain == whole);
            }
        }
    }

    /// No frame leaves a block transfer of the client stuck.
    #[test]
    fn garbage_ends_a_block_transfer(
        upload: bool,
        frames in prop::collection::vec((any::<[u8; 8]>(), 0u8..8, any::<bool>()), 0..60)
    ) {
        let mut c = Channel::new(NODE, TIMEOUT);
        let mut m = Memory::of(&data(500));
        if upload {
            c.upload(DOMAIN, Protocol::Block, ms(0)).unwrap();
        } else {
            c.download(DOMAIN, 500, Protocol::Block, &mut m, ms(0)).unwrap();
        }
        let ended = |p: &Progress<Transfer>| matches!(p, Progress::Done(_) | Progress::Failed(..));
        let mut ends = 0;
        for (mut bytes, command, real) in frames {
            if real {
                bytes[0] = command << 5 | bytes[0] & 0x07;
                bytes[1..4].copy_from_slice(&[0x22, 0x1F, 1]);
                bytes[4] &= 0x7F;
            }
            ends += i32::from(ended(&c.on_frame(&response(bytes), ms(0), &mut m)));
            ends += i32::from(ended(&c.poll(ms(0), &mut m)));
        }
        let mut now = ms(0);
        for _ in 0..1000 {
            now = now.max(c.next_deadline().unwrap_or(now));
            ends += i32::from(ended(&c.poll(now, &mut m)));
        }
        prop_assert_eq!(ends, 1);
        prop_assert!(c.is_ready(now));
    }
}
