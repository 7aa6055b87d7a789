//! The same words for people at the host and for the log of the firmware, where
//! only their numbers are kept in the image.

/// `Display` and `defmt::Format` of a `Copy` type, from one list of patterns.
///
/// A type most of whose values are a fixed text, or a node and a fixed text, has
/// those in sections of their own: on the chip each of them is one number then,
/// not code.
macro_rules! in_words {
    ($type:ty {
        fixed { $($fixed:pat => $text:literal,)* }
        node { $($about:pat => $node:ident $said:literal,)* }
        $($pattern:pat => ($($words:tt)+),)*
    }) => {
        impl core::fmt::Display for $type {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match *self {
                    $($fixed => f.write_str($text),)*
                    $($about => write!(f, concat!("node {}: ", $said), $node),)*
                    $($pattern => write!(f, $($words)+),)*
                }
            }
        }

        #[cfg(feature = "defmt")]
        impl defmt::Format for $type {
            fn format(&self, f: defmt::Formatter<'_>) {
                let (node, words) = match *self {
                    $($fixed => (None, defmt::intern!($text)),)*
                    $($about => (Some($node), defmt::intern!($said)),)*
                    $($pattern => return defmt::write!(f, $($words)+),)*
                };
                match node {
                    None => defmt::write!(f, "{=istr}", words),
                    Some(node) => defmt::write!(f, "node {=u8}: {=istr}", node.get(), words),
                }
            }
        }
    };
    ($type:ty { $($pattern:pat => ($($words:tt)+),)+ }) => {
        impl core::fmt::Display for $type {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match *self {
                    $($pattern => write!(f, $($words)+),)+
                }
            }
        }

        #[cfg(feature = "defmt")]
        impl defmt::Format for $type {
            fn format(&self, f: defmt::Formatter<'_>) {
                match *self {
                    $($pattern => defmt::write!(f, $($words)+),)+
                }
            }
        }
    };
}

pub(crate) use in_words;
