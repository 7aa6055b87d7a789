//! The same words for people at the host, in the log of the firmware, and in its
//! object dictionary.

mod packed;

use packed::Packed;
use proc_macro2::{Delimiter, Group, Literal, TokenStream, TokenTree};
use quote::quote;

/// `Display` and `defmt::Format` of a `Copy` type, from one list of patterns.
///
/// ```text
/// in_words!(Cause {
///     Cause::Restarts => ("restarts again and again"),
///     Cause::Refused { at, code } => ("access to {} refused: {}", at, code),
/// });
/// ```
///
/// On the chip the words cost nothing: as with `#[derive(defmt::Format)]` those of
/// all patterns are one string, which is not in the image, and what goes into the
/// log is the number of the pattern with its values. A pattern that is matched is
/// code, though. Where a type can tell its number itself, `in_words!(Type by
/// function { .. })` has `fn(&Type) -> u8` do it: it counts the patterns from 0.
#[proc_macro]
pub fn in_words(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let both = Words::read(input.into()).and_then(|words| {
        let (display, format) = (words.display(), words.format()?);
        Ok(quote!(#display #[cfg(feature = "defmt")] #format))
    });
    or_error(both)
}

/// `defmt::Format` alone, as [`in_words!`] makes it: for what only goes into the log.
#[proc_macro]
pub fn in_log(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    or_error(Words::read(input.into()).and_then(|words| words.format()))
}

/// Packs texts for the image: `packed!(WORDS: "one", "another")` is a constant
/// `WORDS` of the type `Packed`, which has to be in scope.
#[proc_macro]
pub fn packed(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    or_error(packed_texts(input.into()))
}

fn packed_texts(input: TokenStream) -> Result<TokenStream> {
    let mut input = input.into_iter();
    let name = input.next().ok_or("the name of the constant is missing")?;
    let texts: Vec<TokenTree> = input.skip(1).collect();
    let texts: Result<Vec<Vec<u8>>> = texts
        .split(|token| is(token, ','))
        .filter(|text| !text.is_empty())
        .map(|text| match text {
            [text] => letters(&literal(text)?),
            _ => Err("one string literal after the other"),
        })
        .map(|letters| letters.map(String::into_bytes))
        .collect();
    let texts = texts?;
    if texts
        .iter()
        .flatten()
        .any(|byte| !matches!(byte, b' '..=b'~') || *byte == b'\\')
    {
        return Err("only plain ASCII can be packed");
    }
    let Packed { pairs, texts } = Packed::new(texts);
    let pairs = pairs.iter().map(|[a, b]| quote!([#a, #b]));
    let lengths = texts.iter().map(|text| text.len() as u8);
    let bytes = texts.concat();
    Ok(quote! {
        const #name: Packed = Packed {
            pairs: &[#(#pairs),*],
            bytes: &[#(#bytes),*],
            lengths: &[#(#lengths),*],
        };
    })
}

fn or_error(made: Result<TokenStream>) -> proc_macro::TokenStream {
    made.unwrap_or_else(|error| quote!(compile_error!(#error);))
        .into()
}

/// What stands in the parentheses of the macro.
struct Words {
    name: TokenStream,
    /// What tells the number of a value's pattern, if not the patterns themselves.
    by: Option<TokenStream>,
    lines: Vec<Line>,
}

/// One pattern, its words, and the values in them.
struct Line {
    pattern: TokenStream,
    words: Literal,
    values: Vec<TokenStream>,
}

/// From so many patterns on their number is worked out by itself.
const MANY: usize = 4;

type Result<T> = std::result::Result<T, &'static str>;

impl Words {
    fn read(input: TokenStream) -> Result<Words> {
        let mut head: Vec<TokenTree> = input.into_iter().collect();
        let Some(TokenTree::Group(list)) = head.pop() else {
            return Err("a list of patterns in braces is missing");
        };
        let is_by = |token: &TokenTree| matches!(token, TokenTree::Ident(word) if word == "by");
        let mut parts = head.split(is_by);
        let name = parts.next().unwrap_or_default();
        Ok(Words {
            name: name.iter().cloned().collect(),
            by: parts.next().map(|by| by.iter().cloned().collect()),
            lines: lines(&list)?,
        })
    }

    fn display(&self) -> TokenStream {
        let Words { name, lines, .. } = self;
        let arms = lines.iter().map(|line| {
            let Line {
                pattern,
                words,
                values,
            } = line;
            quote!(#pattern => write!(f, #words #(, #values)*),)
        });
        quote! {
            impl core::fmt::Display for #name {
                fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                    match *self {
                        #(#arms)*
                    }
                }
            }
        }
    }

    /// With the two hidden functions that the derive makes, too: one string with
    /// `|` between the variants; the variant's number, unless there is one alone,
    /// and its values.
    fn format(&self) -> Result<TokenStream> {
        let numbers = (0..=u8::MAX).map(Literal::u8_suffixed);
        let mut all = Vec::new();
        let mut places = Vec::new();
        let mut written = Vec::new();
        for (line, number) in self.lines.iter().zip(numbers) {
            let Line {
                pattern, values, ..
            } = line;
            all.push(line.letters()?);
            places.push(quote!(#pattern => #number,));
            if !values.is_empty() {
                written.push(quote!(#pattern => { #(defmt::export::fmt(&(#values));)* }));
            }
        }
        if all.len() != self.lines.len() {
            return Err("too many patterns");
        }
        let all: Literal = format!("\"{}\"", all.join("|"))
            .parse()
            .map_err(|_| "not the words of a plain string literal")?;
        let name = &self.name;
        let place = match &self.by {
            _ if self.lines.len() == 1 => quote!(),
            Some(by) => quote!(defmt::export::u8(&#by(self));),
            None if places.len() > MANY => quote!({
                // By itself it is a table, else it becomes part of what follows.
                #[inline(never)]
                fn place(value: &#name) -> u8 {
                    match *value { #(#places)* }
                }
                defmt::export::u8(&place(self));
            }),
            None => quote!(defmt::export::u8(&match *self { #(#places)* });),
        };
        if written.len() < self.lines.len() {
            written.push(quote!(_ => {}));
        }
        Ok(quote! {
            impl defmt::Format for #name {
                fn format(&self, f: defmt::Formatter<'_>) {
                    defmt::write!(f, "{}", self);
                }

                fn _format_tag() -> defmt::Str {
                    defmt::intern!(#all)
                }

                #[allow(unused_variables, reason = "the number alone wants no values")]
                fn _format_data(&self) {
                    #place
                    match *self {
                        #(#written)*
                    }
                }
            }
        })
    }
}

impl Line {
    fn letters(&self) -> Result<String> {
        let letters = letters(&self.words)?;
        match letters.contains('|') {
            true => Err("`|` separates the variants"),
            false => Ok(letters),
        }
    }
}

/// What stands between the quotation marks.
fn letters(literal: &Literal) -> Result<String> {
    let text = literal.to_string();
    let letters = text
        .strip_prefix('"')
        .and_then(|text| text.strip_suffix('"'));
    let letters = letters.ok_or("the words have to be a plain string literal")?;
    Ok(letters.to_owned())
}

/// `pattern => ("words", value, value),` as often as it is there.
fn lines(list: &Group) -> Result<Vec<Line>> {
    let mut lines = Vec::new();
    let mut tokens = list.stream().into_iter().peekable();
    while tokens.peek().is_some() {
        let mut pattern: Vec<TokenTree> = Vec::new();
        while !ends_in_arrow(&pattern) {
            pattern.push(tokens.next().ok_or("a pattern without `=>`")?);
        }
        pattern.truncate(pattern.len() - ARROW.len());
        let said = match tokens.next() {
            Some(TokenTree::Group(said)) if said.delimiter() == Delimiter::Parenthesis => said,
            _ => return Err("words and values stand in parentheses"),
        };
        if !tokens.next().is_none_or(|token| is(&token, ',')) {
            return Err("a comma is missing after a pattern's words");
        }
        lines.push(line(pattern.into_iter().collect(), &said)?);
    }
    Ok(lines)
}

fn line(pattern: TokenStream, said: &Group) -> Result<Line> {
    let said: Vec<TokenTree> = said.stream().into_iter().collect();
    let mut parts = said.split(|token| is(token, ','));
    let Some([words]) = parts.next() else {
        return Err("the words are missing");
    };
    Ok(Line {
        pattern,
        words: literal(words)?,
        values: parts
            .filter(|value| !value.is_empty())
            .map(|value| value.iter().cloned().collect())
            .collect(),
    })
}

fn literal(token: &TokenTree) -> Result<Literal> {
    match token {
        TokenTree::Literal(literal) => Ok(literal.clone()),
        // One that comes through another macro is wrapped.
        TokenTree::Group(group) if group.delimiter() == Delimiter::None => {
            literal(&group.stream().into_iter().next().ok_or("no words")?)
        }
        _ => Err("the words have to be a string literal"),
    }
}

const ARROW: [char; 2] = ['=', '>'];

fn ends_in_arrow(tokens: &[TokenTree]) -> bool {
    let Some((_, last)) = tokens.split_last_chunk() else {
        return false;
    };
    let [a, b]: &[TokenTree; ARROW.len()] = last;
    is(a, ARROW[0]) && is(b, ARROW[1])
}

fn is(token: &TokenTree, letter: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == letter)
}
