//! Numbers as EDS files write them (CiA 306, 4.3).

use crate::object::DataType;

/// A number, with the node-ID to be added or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// The number, or what is added to the node-ID.
    pub value: i128,
    /// It was written with `$NODEID`.
    pub plus_node_id: bool,
    /// It was written in hexadecimal: a pattern of bits rather than a quantity.
    hex: bool,
}

const NODE_ID: &str = "$nodeid";

impl Number {
    /// A plain number.
    pub const fn plain(value: i128) -> Number {
        Number {
            value,
            plus_node_id: false,
            hex: false,
        }
    }

    /// Reads a number: decimal, `0x` hexadecimal, octal with a leading zero, with
    /// `$NODEID` before or after a plus sign, in any case, with blanks anywhere,
    /// in quotes, and with a comment behind.
    pub fn parse(text: &str) -> Option<Number> {
        let text = text.split(';').next().unwrap_or_default();
        let text: String = text
            .chars()
            .filter(|c| !c.is_whitespace() && *c != '"')
            .collect();
        let text = text.to_ascii_lowercase();
        if !text.contains(NODE_ID) {
            let (value, hex) = literal(&text)?;
            return Some(Number {
                value,
                plus_node_id: false,
                hex,
            });
        }
        let rest = if let Some(rest) = text.strip_prefix(NODE_ID) {
            match rest.strip_prefix('+') {
                Some(rest) => rest,
                None if rest.is_empty() => "0",
                None => return None,
            }
        } else {
            text.strip_suffix(NODE_ID)?.strip_suffix('+')?
        };
        let (value, hex) = literal(rest)?;
        Some(Number {
            value,
            plus_node_id: true,
            hex,
        })
    }

    /// The number for a node. Sums of identifiers stay far below the limit; what
    /// does not is no identifier, so it saturates.
    pub fn with_node_id(self, node: u8) -> i128 {
        if self.plus_node_id {
            self.value.saturating_add(i128::from(node))
        } else {
            self.value
        }
    }

    /// The value of an entry of this type: a pattern of bits such as 0xFFFF of an
    /// INTEGER16 is negative.
    pub fn of_type(self, data_type: DataType, node: u8) -> i128 {
        let value = self.with_node_id(node);
        match data_type.range() {
            Some((min, max)) if self.hex && min < 0 && value > max && value <= 2 * max + 1 => {
                value + 2 * min
            }
            _ => value,
        }
    }
}

/// A literal, and whether it is hexadecimal.
fn literal(text: &str) -> Option<(i128, bool)> {
    const HEX: u32 = 16;
    const OCTAL: u32 = 8;
    const DECIMAL: u32 = 10;
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text.strip_prefix('+').unwrap_or(text)),
    };
    // `from_str_radix` takes a second sign.
    if !digits.starts_with(|c: char| c.is_ascii_hexdigit()) {
        return None;
    }
    let parse = |digits: &str, radix| {
        let plain = digits.starts_with(|c: char| c.is_ascii_hexdigit());
        i128::from_str_radix(digits, radix).ok().filter(|_| plain)
    };
    let (value, hex) = if let Some(hex) = digits.strip_prefix("0x") {
        (parse(hex, HEX)?, true)
    } else if digits.len() > 1 && digits.starts_with('0') {
        // Octal by the standard; but no tool means octal by 08.
        let value = parse(digits, OCTAL).or_else(|| parse(digits, DECIMAL))?;
        (value, false)
    } else {
        (parse(digits, DECIMAL)?, false)
    };
    // Nothing in an object dictionary is larger than 64 bits.
    let fits = (i128::from(i64::MIN)..=i128::from(u64::MAX)).contains(&(sign * value));
    fits.then_some((sign * value, hex))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Option<i128> {
        Number::parse(text).map(|number| number.with_node_id(5))
    }

    #[test]
    fn the_ways_to_write_a_number() {
        for (text, expected) in [
            ("0", 0),
            ("16", 16),
            (" 16 ", 16),
            ("0x10", 16),
            ("0X1f", 31),
            ("-3", -3),
            ("-0x3", -3),
            ("+7", 7),
            ("010", 8),
            ("08", 8),
            ("00", 0),
            ("0x80000000 ; off", 0x8000_0000),
            ("\"0x10\"", 16),
            ("$NODEID", 5),
            ("$NODEID+0x200", 0x205),
            ("$nodeid + 512", 0x205),
            ("0x200+$NodeID", 0x205),
            ("0xFFFFFFFFFFFFFFFF", i128::from(u64::MAX)),
            ("-9223372036854775808", i128::from(i64::MIN)),
        ] {
            assert_eq!(value(text), Some(expected), "{text}");
        }
    }

    #[test]
    fn what_is_not_a_number() {
        for text in [
            "",
            "-",
            "0x",
            "--1",
            "0x-1",
            "abc",
            "1.5",
            "$NODEID-1",
            "$NODEID+",
            "$NODEID$NODEID",
            "+$NODEID",
            "0x1FFFFFFFFFFFFFFFF",
            "0x+1",
            "1 2x",
        ] {
            assert_eq!(value(text), None, "{text}");
        }
    }

    #[test]
    fn hexadecimal_is_a_pattern_of_bits() {
        let of = |text: &str, bits| {
            Number::parse(text)
                .unwrap()
                .of_type(DataType::Integer(bits), 1)
        };
        assert_eq!(of("0xFFFD", 16), -3);
        assert_eq!(of("0x80000000", 32), i128::from(i32::MIN));
        assert_eq!(of("0x7F", 8), 127);
        assert_eq!(of("65533", 16), 65533);
        assert_eq!(of("0x1FFFF", 16), 0x1FFFF);
    }
}
