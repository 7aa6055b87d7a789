//! Where the description stands, and what is wrong with it so far.

use std::ops::RangeInclusive;

use toml::Spanned;

use crate::problem::{Place, Problems, nearest};
use crate::source::Source;

pub(crate) struct Context<'a> {
    pub(crate) source: &'a Source,
    pub(crate) problems: &'a mut Problems,
}

impl Context<'_> {
    pub(crate) fn at<T>(&self, value: &Spanned<T>) -> Place {
        Place::at(self.source, &value.span())
    }

    /// A number within `range`.
    pub(crate) fn number<T: TryFrom<i64>>(
        &mut self,
        value: &Spanned<i64>,
        key: &str,
        range: RangeInclusive<i64>,
    ) -> Option<T> {
        let number = *value.get_ref();
        if range.contains(&number)
            && let Ok(number) = T::try_from(number)
        {
            return Some(number);
        }
        let place = self.at(value);
        let (low, high) = range.into_inner();
        let nearest = number.clamp(low, high);
        self.problems.error(
            &place,
            number,
            format!("{key} must be {low} ..= {high}"),
            format!("the nearest that is allowed is {nearest}"),
        );
        None
    }

    /// One of the words that a key may have; the first, if the key is not there.
    pub(crate) fn word<T: Copy>(
        &mut self,
        value: Option<&Spanned<String>>,
        key: &str,
        words: &[(&str, T)],
    ) -> Option<T> {
        let Some(value) = value else {
            return words.first().map(|(_, meaning)| *meaning);
        };
        let found = words.iter().find(|(word, _)| *word == value.get_ref());
        if found.is_none() {
            let known = || words.iter().map(|(word, _)| *word);
            let place = self.at(value);
            let all: Vec<String> = known().map(|word| format!("\"{word}\"")).collect();
            self.problems.error(
                &place,
                value.get_ref(),
                format!("{key} must be {}", all.join(" or ")),
                match nearest(value.get_ref(), known()) {
                    Some(word) => format!("did you mean \"{word}\"?"),
                    None => "write one of these, or leave it out".to_string(),
                },
            );
        }
        found.map(|(_, meaning)| *meaning)
    }

    /// A number, if the key is there.
    pub(crate) fn optional<T: TryFrom<i64>>(
        &mut self,
        value: Option<&Spanned<i64>>,
        key: &str,
        range: RangeInclusive<i64>,
    ) -> Option<T> {
        self.number(value?, key, range)
    }
}
