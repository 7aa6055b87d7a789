use super::*;
use proptest::prelude::*;

fn text(frame: &WireFrame) -> String {
    format!("{:?}", frame.encode())
}

/// Takes the stuff bits out again; `None` where a sixth equal bit stands.
fn destuff(bits: impl Iterator<Item = bool>) -> Option<Vec<bool>> {
    let (mut out, mut last, mut run) = (Vec::new(), true, 0);
    for bit in bits {
        if run == 5 {
            if bit == last {
                return None;
            }
            run = 1;
        } else {
            run = if bit == last { run + 1 } else { 1 };
            out.push(bit);
        }
        last = bit;
    }
    Some(out)
}

#[test]
fn golden_sync() {
    // SYNC, identifier 080h, no data. SOF + 00010000000 + RTR IDE r0 + DLC 0:
    // 0 00010000000 0 0 0 0000 and the CRC-15 of these 19 bits.
    let sync = WireFrame::standard(0x080, &[]);
    let (header, n) = sync.header_and_data();
    assert_eq!((header, n), (0b000_0100_0000_0000_0000, 19));
    // By long division, written out apart from the code under test.
    let mut rest = header << 15;
    for i in (15..15 + n).rev() {
        if rest >> i & 1 == 1 {
            rest ^= 0b1100_0101_1001_1001 << (i - 15);
        }
    }
    let mut plain: Vec<bool> = (0..n).rev().map(|i| header >> i & 1 == 1).collect();
    plain.extend((0..15).rev().map(|i| rest >> i & 1 == 1));
    let bits = sync.encode();
    let stuffed = bits.iter().take(bits.stuffed_len() as usize);
    assert_eq!(destuff(stuffed).unwrap(), plain);
    assert!(text(&sync).starts_with("00001000001000001000"));
    assert!(text(&sync).ends_with("1111111111"));
}

#[test]
fn lengths_without_stuffing_and_at_worst() {
    // protocol.md: 47 + 8n without stuffing, 55 + 10n at worst.
    let (plain, worst): (Vec<u32>, Vec<u32>) = (0..=8).map(|n| (47 + 8 * n, 55 + 10 * n)).unzip();
    assert_eq!(plain, [47, 55, 63, 71, 79, 87, 95, 103, 111]);
    assert_eq!(worst, [55, 65, 75, 85, 95, 105, 115, 125, 135]);
    for n in 0..=8usize {
        for id in 0..0x800 {
            let alternating = WireFrame::standard(id, &[0x55; 8][..n]).bits();
            let zeros = WireFrame::standard(id, &[0; 8][..n]).bits();
            for bits in [alternating, zeros] {
                assert!((plain[n]..=worst[n]).contains(&bits), "{id:03X} {n} {bits}");
            }
        }
    }
    // A frame without any stuff bit exists, so the lower bound is exact.
    let unstuffed = (0..0x800).any(|id| WireFrame::standard(id, &[0x55; 8]).bits() == 111);
    assert!(unstuffed);
}

#[test]
fn long_runs_carry_many_stuff_bits() {
    // 000h with eight zero bytes: SOF to DLC are 19 bits of which only the
    // DLC's first is recessive, and the data is all dominant.
    let bits = WireFrame::standard(0, &[0; 8]).encode();
    assert!(text(&WireFrame::standard(0, &[0; 8])).starts_with("0000010000010000011000001000001"));
    assert!(bits.len() >= 108 + 16);
}

#[test]
fn a_remote_frame_has_a_length_but_no_data() {
    let data = WireFrame::standard(0x701, &[0; 8]);
    let remote = WireFrame { rtr: true, ..data };
    assert!(remote.is_empty());
    assert!(remote.bits() < data.bits());
    assert_eq!(remote.header_and_data(), (0b011_1000_0000_1100_1000, 19));
}

#[test]
fn extended_frames_have_20_bits_more() {
    let (_, base) = WireFrame::standard(0x555, &[]).header_and_data();
    let (bits, extended) = WireFrame::extended(0x1555_5555, &[]).header_and_data();
    assert_eq!((base, extended), (19, 39));
    // SRR and IDE recessive behind the base identifier.
    assert_eq!(bits >> (39 - 14) & 0b11, 0b11);
    for n in 0..=8 {
        let frame = WireFrame::extended(0, &[0; 8][..n]);
        let region = 54 + 8 * n as u32;
        assert!(frame.bits() <= region + (region - 1) / 4 + TAIL_BITS + INTERMISSION_BITS);
    }
}

#[test]
fn arbitration_order_is_the_order_on_the_wire() {
    let key = |f: WireFrame| f.arbitration_key();
    let data = WireFrame::standard(0x123, &[1]);
    let remote = WireFrame::remote(WireId::Standard(0x123), 1);
    let extended = WireFrame::extended(0x123 << 18, &[]);
    assert!(key(data) < key(remote));
    assert!(key(remote) < key(extended));
    assert!(key(extended) < key(WireFrame::standard(0x124, &[])));
    assert!(key(extended) < key(WireFrame::remote(WireId::Extended(0x123 << 18), 0)));
}

#[test]
fn the_librarys_frames_survive_the_round_trip() {
    let sync = Frame::empty(CobId::SYNC);
    assert_eq!(Frame::try_from(WireFrame::from(sync)), Ok(sync));
    assert!(!WireFrame::from(sync).rtr);
    let guard = Frame::remote_frame(CobId::new(0x701).unwrap(), 1).unwrap();
    assert_eq!(Frame::try_from(WireFrame::from(guard)), Ok(guard));
    assert_eq!(
        Frame::try_from(WireFrame::extended(1, &[])),
        Err(NotCanopen::Extended(1))
    );
    let mut long = WireFrame::standard(1, &[0; 8]);
    long.dlc = 9;
    assert_eq!(long.len(), 8);
    assert_eq!(Frame::try_from(long), Err(NotCanopen::Dlc(9)));
}

fn any_frame() -> impl Strategy<Value = WireFrame> {
    let id = prop_oneof![
        (0u16..0x800).prop_map(WireId::Standard),
        (0u32..0x2000_0000).prop_map(WireId::Extended),
    ];
    let byte = prop_oneof![Just(0u8), Just(0xFF), any::<u8>()];
    (id, any::<bool>(), 0u8..=15, prop::array::uniform8(byte))
        .prop_map(|(id, rtr, dlc, data)| WireFrame { id, rtr, dlc, data })
}

proptest! {
    #[test]
    fn stuffing_is_right(frame in any_frame()) {
        let bits = frame.encode();
        let plain = destuff(bits.iter().take(bits.stuffed_len() as usize));
        let plain = plain.expect("never six equal bits");
        let (header, n) = frame.header_and_data();
        prop_assert_eq!(plain.len() as u32, n + 15);
        for i in 0..n {
            prop_assert_eq!(plain[i as usize], header >> (n - 1 - i) & 1 == 1);
        }
        // A CRC over data and CRC leaves nothing.
        prop_assert_eq!(plain.iter().fold(0, |crc, &bit| crc15(crc, bit)), 0);
        let region = n + 15;
        let stuff = bits.stuffed_len() - region;
        prop_assert!(stuff <= (region - 1) / 4);
        prop_assert_eq!(bits.len(), bits.stuffed_len() + TAIL_BITS);
        prop_assert_eq!(frame.bits(), bits.len() + INTERMISSION_BITS);
    }

    #[test]
    fn lower_key_is_dominant_where_the_bits_first_differ(a in any_frame(), b in any_frame()) {
        let (x, y) = (a.encode(), b.encode());
        prop_assume!(a.arbitration_key() != b.arbitration_key());
        let first = (0..x.len()).find(|&i| x.get(i) != y.get(i)).unwrap();
        prop_assert_eq!(a.arbitration_key() < b.arbitration_key(), !x.get(first));
    }
}
