//! What a value says, for people.

pub(crate) use canmaster_words::in_words;
