//! Texts in as few bytes as reading them with little code allows: the two bytes that
//! stand side by side most often become one, again and again.

/// The bytes from here on, and past the last one those from 0 on, stand for two others;
/// in between are the letters.
const FIRST_PAIR: u8 = 128;
const PAIRS: u8 = (u8::MAX - FIRST_PAIR + 1) + b' ';
/// A pair takes two bytes in the table.
const WORTH_IT: usize = 3;

/// What is made of some texts.
pub(crate) struct Packed {
    /// What each byte from [`FIRST_PAIR`] on stands for.
    pub(crate) pairs: Vec<[u8; 2]>,
    pub(crate) texts: Vec<Vec<u8>>,
}

impl Packed {
    /// Packs texts of ASCII.
    pub(crate) fn new(texts: Vec<Vec<u8>>) -> Packed {
        let mut packed = Packed {
            pairs: Vec::new(),
            texts,
        };
        for number in 0..PAIRS {
            let byte = FIRST_PAIR.wrapping_add(number);
            let Some(pair) = packed.most_frequent() else {
                break;
            };
            for text in &mut packed.texts {
                replace(text, pair, byte);
            }
            packed.pairs.push(pair);
        }
        packed
    }

    /// The pair to be replaced next; among equals the first one, so that the same
    /// texts always give the same bytes.
    fn most_frequent(&self) -> Option<[u8; 2]> {
        let mut counts = std::collections::BTreeMap::new();
        for pair in self.texts.iter().flat_map(|text| text.windows(2)) {
            if let [a, b] = *pair {
                *counts.entry([a, b]).or_insert(0_usize) += 1;
            }
        }
        let (pair, count) = counts.into_iter().rev().max_by_key(|(_, count)| *count)?;
        (count >= WORTH_IT).then_some(pair)
    }
}

fn replace(text: &mut Vec<u8>, pair: [u8; 2], byte: u8) {
    let mut rest = core::mem::take(text).into_iter().peekable();
    while let Some(first) = rest.next() {
        if first == pair[0] && rest.next_if_eq(&pair[1]).is_some() {
            text.push(byte);
        } else {
            text.push(first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unpack(packed: &Packed, byte: u8, to: &mut Vec<u8>) {
        match packed.pairs.get(usize::from(byte.wrapping_sub(FIRST_PAIR))) {
            None => to.push(byte),
            Some(pair) => {
                for byte in pair {
                    unpack(packed, *byte, to);
                }
            }
        }
    }

    #[test]
    fn letters_stay_letters_however_many_pairs_there_are() {
        let letters = (b' '..=b'~').flat_map(|a| [[a, b'a', a], [a, b'b', a], [a, b'a', a]]);
        let texts: Vec<Vec<u8>> = letters.map(|text| text.repeat(2)).collect();
        let packed = Packed::new(texts.clone());
        assert_eq!(packed.pairs.len(), usize::from(PAIRS));
        for (text, packed_text) in texts.iter().zip(&packed.texts) {
            let mut unpacked = Vec::new();
            for byte in packed_text {
                unpack(&packed, *byte, &mut unpacked);
            }
            assert_eq!(&unpacked, text);
        }
    }

    #[test]
    fn what_is_packed_is_less_and_can_be_unpacked() {
        let texts = ["sensor error", "sensor not found", "error", "", "aaaaaaa"];
        let bytes: Vec<Vec<u8>> = texts.iter().map(|text| text.as_bytes().to_vec()).collect();
        let packed = Packed::new(bytes.clone());
        assert!(!packed.pairs.is_empty());
        let length = |texts: &[Vec<u8>]| texts.iter().map(Vec::len).sum::<usize>();
        assert!(length(&packed.texts) + 2 * packed.pairs.len() < length(&bytes));
        for (text, packed_text) in bytes.iter().zip(&packed.texts) {
            let mut unpacked = Vec::new();
            for byte in packed_text {
                unpack(&packed, *byte, &mut unpacked);
            }
            assert_eq!(&unpacked, text);
        }
    }
}
