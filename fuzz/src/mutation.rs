//! Random inputs, and mutations of existing inputs.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::GzEncoder;
use rand::{Rng, RngExt as _};

/// Longest input, in bytes.
const LONGEST: usize = 1 << 16;

/// Numbers on which readers often fail.
const NUMBERS: [&str; 24] = [
    "0",
    "-0",
    "1",
    "-1",
    "0.5",
    "1,5",
    "1e308",
    "-1e308",
    "1e309",
    "5e-324",
    "1e-400",
    "NaN",
    "inf",
    "-inf",
    "9007199254740993",
    "18446744073709551616",
    "4294967295",
    "2147483648",
    "1.",
    ".5",
    "+1",
    "1e",
    "0x10",
    "1_000",
];

/// Bytes with a special meaning in at least one format.
const BYTES: &[u8] = b"\0\t\n\r\x1b \"#'+,-.:;[]{}\x7f\x80\xff";

/// Maximum length of an input of random bytes, in bytes.
const MOST_BYTES: usize = 1 << 10;

/// Returns an input of random bytes.
pub fn bytes(random: &mut impl Rng) -> Vec<u8> {
    let mut input = vec![0; random.random_range(0..=MOST_BYTES)];
    random.fill_bytes(&mut input);
    input
}

/// Returns an input with other digits or, in a binary file, other bytes of numbers. The reader
/// accepts most of these inputs.
pub fn renumbered(corpus: &[Vec<u8>], random: &mut impl Rng) -> Vec<u8> {
    let mut input = corpus[random.random_range(0..corpus.len())].clone();
    let is_text = !input.iter().take(1 << 9).any(|byte| *byte == 0 || *byte >= 0x80);
    let len = input.len();
    let most = 1 << random.random_range(0..10);
    for _ in 0..random.random_range(1..=most) {
        let at = random.random_range(0..len.max(1));
        match input.get_mut(at) {
            Some(byte) if is_text && byte.is_ascii_digit() => {
                *byte = b'0' + random.random_range(0..10_u8);
            }
            // The numbers of a binary file are mostly at its end.
            Some(byte) if !is_text && 2 * at > len => *byte = random.random(),
            _ => {}
        }
    }
    input
}

/// Returns an input of the corpus with random changes, fewer than 2^`most` in number.
pub fn mutated(corpus: &[Vec<u8>], words: &[&str], random: &mut impl Rng, most: u32) -> Vec<u8> {
    let mut input = corpus[random.random_range(0..corpus.len())].clone();
    // Usually the changes are few, sometimes many.
    let changes = 1 << random.random_range(0..most);
    for _ in 0..random.random_range(1..=changes) {
        change(&mut input, corpus, words, random);
        input.truncate(LONGEST);
    }
    if random.random_ratio(1, 30) {
        input = packed(&input);
    }
    input
}

fn change(input: &mut Vec<u8>, corpus: &[Vec<u8>], words: &[&str], random: &mut impl Rng) {
    let at = random.random_range(0..=input.len());
    let longest = 1 << random.random_range(0..12);
    let len = random.random_range(0..=(input.len() - at).min(longest));
    match random.random_range(0..14) {
        0 => replace(input, at, 1, &[random.random()]),
        1 => replace(input, at, 1, &[BYTES[random.random_range(0..BYTES.len())]]),
        2 => {
            if let Some(byte) = input.get_mut(at) {
                *byte ^= 1 << random.random_range(0..8);
            }
        }
        3 => replace(input, at, len, &[]),
        4 => {
            // A piece of the input is repeated at another position.
            let piece = input[at..at + len].to_vec();
            let to = random.random_range(0..=input.len());
            replace(input, to, 0, &piece);
        }
        5 => {
            let other = &corpus[random.random_range(0..corpus.len())];
            let from = random.random_range(0..=other.len());
            let to = random.random_range(from..=other.len());
            replace(input, at, len, &other[from..to]);
        }
        6 => input.truncate(at),
        7 => {
            // A binary number overwrites some bytes, as if a length or an offset had another value.
            let number: u64 = match random.random_range(0..5) {
                0 => 0,
                1 => 1 << random.random_range(0..64),
                2 => (1 << random.random_range(0..64)) - 1,
                3 => random.random_range(0..64),
                _ => random.random(),
            };
            let bytes = if random.random() { number.to_le_bytes() } else { number.to_be_bytes() };
            let width = 1 << random.random_range(0..4);
            replace(input, at, width, &bytes[..width]);
        }
        8 => replace(input, at, 8, &f64::from_bits(random.random()).to_le_bytes()),
        9 => {
            let number = NUMBERS[random.random_range(0..NUMBERS.len())];
            let at = digit_from(input, at);
            let len =
                input[at..].iter().take_while(|b| b"+-.,eE".contains(b) || b.is_ascii_digit());
            let len = len.count();
            replace(input, at, len, number.as_bytes());
        }
        10 => {
            let byte = BYTES[random.random_range(0..BYTES.len())];
            let count = 1 << random.random_range(0..14);
            replace(input, at, 0, &vec![byte; count]);
        }
        11 if !words.is_empty() => {
            let word = words[random.random_range(0..words.len())];
            replace(input, at, if random.random() { len } else { 0 }, word.as_bytes());
        }
        12 => {
            // A line is removed, moved or doubled.
            let mut lines: Vec<&[u8]> = input.split(|b| *b == b'\n').collect();
            let line = random.random_range(0..lines.len());
            let moved = lines.remove(line);
            for _ in 0..random.random_range(0..3) {
                lines.insert(random.random_range(0..=lines.len()), moved);
            }
            *input = lines.join(&b'\n');
        }
        _ => {
            // A delimiter or decimal sign is replaced throughout.
            let marks = b",;\t .\n";
            let [from, to] = [0; 2].map(|_: i32| marks[random.random_range(0..marks.len())]);
            input.iter_mut().filter(|b| **b == from).for_each(|b| *b = to);
        }
    }
}

/// Replaces `len` bytes, beginning at position `at`, by the bytes `by`; replaces fewer if the input
/// ends earlier.
fn replace(input: &mut Vec<u8>, at: usize, len: usize, by: &[u8]) {
    let end = (at + len).min(input.len());
    input.splice(at..end, by.iter().copied());
}

/// Returns the position of the next digit from `at` on, or `at` if there is none.
fn digit_from(input: &[u8], at: usize) -> usize {
    let skipped = input[at..].iter().position(u8::is_ascii_digit);
    at + skipped.unwrap_or(0)
}

fn packed(input: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    // Writing to memory does not fail.
    let _ = encoder.write_all(input);
    encoder.finish().unwrap_or_default()
}
