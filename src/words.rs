//! What a value says, for people.

pub(crate) use canmaster_words::{in_words, packed};

/// Texts of ASCII, made by [`packed!`]: a byte of 32..=127 is a letter, any other stands
/// for the two bytes of a pair.
pub(crate) struct Packed {
    pub(crate) pairs: &'static [[u8; 2]],
    /// One text after the other.
    pub(crate) bytes: &'static [u8],
    /// Of each text, in bytes.
    pub(crate) lengths: &'static [u8],
}

/// A packed text.
#[derive(Clone, Copy)]
pub(crate) struct PackedText {
    pairs: &'static [[u8; 2]],
    bytes: &'static [u8],
}

impl Packed {
    /// The text that begins behind so many bytes.
    pub(crate) fn text(&self, start: usize, len: usize) -> PackedText {
        PackedText {
            pairs: self.pairs,
            bytes: self.bytes.get(start..start + len).unwrap_or_default(),
        }
    }
}

impl PackedText {
    /// Gives the letters, one after the other.
    pub(crate) fn spell(&self, put: &mut dyn FnMut(u8)) {
        for byte in self.bytes {
            self.unpack(*byte, put);
        }
    }

    fn unpack(&self, byte: u8, put: &mut dyn FnMut(u8)) {
        // Of a letter that is a place behind the last pair.
        let pair = byte.wrapping_sub(FIRST_PAIR);
        match self.pairs.get(usize::from(pair)) {
            None => put(byte),
            Some([first, second]) => {
                self.unpack(*first, put);
                self.unpack(*second, put);
            }
        }
    }
}

const FIRST_PAIR: u8 = 128;
