//! Answers that come late: in the quarantine, after it, and into the next
//! transfer; and two servers that answer on one COB-ID.

use crate::common::{DOMAIN, Dictionary, Memory, NODE, TIMEOUT, ms, response};
use crate::wire::{KINDS, To, Wire, data, frames};
use canmaster::id::Address;
use canmaster::sdo::{AbortCode, Channel, Progress, Protocol, SdoError, Server, StartError};
use canmaster::{Duration, Frame};

const NAME: Address = Address::new(0x1008, 0);

/// The server is too slow from the frame `from` on: what it answered is kept.
fn slow(kind: crate::wire::Kind, whole: &[u8], from: usize) -> (Wire, Vec<Frame>) {
    let mut wire = Wire::new();
    wire.od.domain = whole.to_vec();
    wire.begin(kind, whole);
    let mut late = vec![];
    let result = wire.run(|number, to, frame| {
        if to == To::Client && number >= from {
            late.push(frame);
            return None;
        }
        Some(frame)
    });
    assert_eq!(
        result.map_err(|error| error.code()),
        Err(AbortCode::TIMEOUT)
    );
    (wire, late)
}

#[test]
fn what_comes_in_the_quarantine_or_after_it_is_discarded() {
    let whole = data(50);
    for kind in KINDS {
        for from in 0..frames(kind, &whole) - 1 {
            let (mut wire, late) = slow(kind, &whole, from);
            let closed = wire.now;
            let opens = closed + Duration::from_millis(500);
            assert_eq!(wire.channel.next_deadline(), Some(opens));
            for after in [0, 1, 250, 499, 500, 501, 10_000] {
                wire.now = closed + Duration::from_millis(after);
                if after < 500 {
                    assert_eq!(
                        wire.channel.upload(NAME, Protocol::Normal, wire.now),
                        Err(StartError::Quarantine { until: opens })
                    );
                }
                for frame in &late {
                    assert_eq!(wire.say(*frame), Progress::Nothing, "{kind:?}, {after} ms");
                }
            }
            assert!(wire.channel.is_ready(wire.now));
        }
    }
}

/// Every late answer that names its entry, at every moment of a transfer of
/// another entry.
#[test]
fn a_late_answer_that_names_another_entry_changes_nothing() {
    let named = |frame: &Frame| {
        let [_, low, high, sub, ..] = frame.padded();
        Address::new(u16::from_le_bytes([low, high]), sub) == DOMAIN
    };
    let whole = data(50);
    for kind in KINDS {
        for from in 0..frames(kind, &whole) - 1 {
            let (_, late) = slow(kind, &whole, from);
            for late in late.into_iter().filter(named) {
                for moment in 0..5 {
                    let mut c = Channel::new(NODE, TIMEOUT);
                    let mut m = Memory::default();
                    let mut s = Server::new(NODE, TIMEOUT);
                    let od = &mut Dictionary::new();
                    let mut next = c.upload(NAME, Protocol::Normal, ms(0)).unwrap();
                    let mut step = 0;
                    loop {
                        if step == moment {
                            let progress = c.on_frame(&late, ms(0), &mut m);
                            assert_eq!(progress, Progress::Nothing, "{late:?} at {moment}");
                        }
                        step += 1;
                        let answer = s.on_frame(&next, ms(0), od).unwrap();
                        match c.on_frame(&answer, ms(0), &mut m) {
                            Progress::Send(frame) => next = frame,
                            Progress::Done(_) => break,
                            other => panic!("{other:?}"),
                        }
                    }
                    assert_eq!(m.data, b"EPOS4");
                }
            }
        }
    }
}

/// What remains possible, and is documented at [`Channel`]: the same entry,
/// later than timeout and quarantine.
#[test]
fn an_answer_later_than_the_quarantine_is_taken_for_that_to_the_same_entry() {
    let at = Address::new(0x1017, 0);
    let mut c = Channel::new(NODE, TIMEOUT);
    let mut m = Memory::default();
    let late = response([0x4B, 0x17, 0x10, 0, 1, 0, 0, 0]);
    c.upload(at, Protocol::Normal, ms(0)).unwrap();
    assert!(matches!(c.poll(ms(500), &mut m), Progress::Failed(..)));
    c.upload(at, Protocol::Normal, ms(1000)).unwrap();
    assert!(matches!(
        c.on_frame(&late, ms(1001), &mut m),
        Progress::Done(_)
    ));
    // A longer quarantine is the remedy.
    let mut c = Channel::new(NODE, TIMEOUT).with_quarantine(Duration::from_millis(5000));
    c.upload(at, Protocol::Normal, ms(0)).unwrap();
    let _ = c.poll(ms(500), &mut m);
    assert!(c.upload(at, Protocol::Normal, ms(1000)).is_err());
    assert_eq!(c.on_frame(&late, ms(1001), &mut m), Progress::Nothing);
}

/// The same with a segment, which names no entry: its toggle and the announced
/// size are all that there is to tell it by.
#[test]
fn a_segment_later_than_the_quarantine_is_told_by_its_toggle_and_the_size() {
    let late = *b"\x00EPOS4 5";
    for (size, toggle, ends) in [(20, 0x00, false), (20, 0x10, true), (6, 0x00, true)] {
        let mut c = Channel::new(NODE, TIMEOUT);
        let mut m = Memory::default();
        c.upload(DOMAIN, Protocol::Normal, ms(1000)).unwrap();
        let _ = c.on_frame(
            &response([0x41, 0x22, 0x1F, 1, size, 0, 0, 0]),
            ms(1000),
            &mut m,
        );
        let mut bytes = late;
        bytes[0] |= toggle;
        let progress = c.on_frame(&response(bytes), ms(1000), &mut m);
        assert_eq!(
            matches!(progress, Progress::Failed(..)),
            ends,
            "{progress:?}"
        );
    }
}

/// Two servers with one node-ID: the second's answers come `delay` answers after
/// the first's, before them or behind them. Both hold as much, of another kind.
fn twins(kind: crate::wire::Kind, len: usize, delay: usize, first: bool) -> Option<Vec<u8>> {
    let mut c = Channel::new(NODE, TIMEOUT);
    let mut m = Memory::of(&vec![b'c'; len]);
    let mut servers = [b'a', b'b'].map(|content| {
        let mut od = Dictionary::new();
        od.domain = vec![content; len];
        (Server::new(NODE, TIMEOUT).with_block_size(3), od)
    });
    let request = if kind.upload {
        c.upload(DOMAIN, kind.protocol, ms(0))
    } else {
        c.download(DOMAIN, len as u32, kind.protocol, &mut m, ms(0))
    };
    let mut requests = vec![request.unwrap()];
    let mut answers = [vec![], vec![]];
    let mut now = ms(0);
    for _ in 0..10_000 {
        for frame in std::mem::take(&mut requests) {
            for ((server, od), answers) in servers.iter_mut().zip(&mut answers) {
                answers.extend(server.on_frame(&frame, now, od));
            }
        }
        for ((server, od), answers) in servers.iter_mut().zip(&mut answers) {
            answers.extend(server.poll(now, od));
        }
        let mut heard = vec![];
        if !answers[0].is_empty() {
            heard.push(answers[0].remove(0));
        }
        if answers[1].len() > delay || answers[0].is_empty() && !answers[1].is_empty() {
            let second = answers[1].remove(0);
            heard.insert(if first { 0 } else { heard.len() }, second);
        }
        let idle = heard.is_empty();
        let mut progress: Vec<_> = heard
            .iter()
            .map(|frame| c.on_frame(frame, now, &mut m))
            .collect();
        progress.push(c.poll(now, &mut m));
        for progress in progress {
            match progress {
                Progress::Nothing => {}
                Progress::Send(frame) => requests.push(frame),
                Progress::Done(_) => return Some(m.data),
                Progress::Failed(error, abort) => {
                    assert!(!matches!(error, SdoError::Aborted { .. }) || abort.is_none());
                    let free = now + Duration::from_millis(1000);
                    let _ = c.poll(free, &mut m);
                    assert!(c.is_ready(free));
                    return None;
                }
            }
        }
        if idle && requests.is_empty() {
            let servers = servers
                .iter()
                .filter_map(|(server, _)| server.next_deadline());
            let next = servers.chain(c.next_deadline()).min();
            now = now.max(next.expect("somebody waits"));
        }
    }
    panic!("no end");
}

#[test]
fn two_servers_on_one_identifier_end_the_transfer_or_do_not_mix() {
    let mut ended = 0;
    for kind in KINDS {
        for len in [1, 4, 5, 7, 8, 20, 21, 50, 100] {
            for delay in 0..6 {
                for first in [false, true] {
                    let Some(data) = twins(kind, len, delay, first) else {
                        ended += 1;
                        continue;
                    };
                    let name = std::format!("{kind:?}, {len} bytes, {delay} late");
                    assert_eq!(data.len(), len, "{name}");
                    assert!(data.iter().all(|byte| *byte == data[0]), "{name}: {data:?}");
                }
            }
        }
    }
    assert!(ended > 50, "{ended}");
}
