//! Comments of every kind, public, private and inside functions: they are whole sentences of plain
//! words, and wrapped.

use std::fs;
use std::path::{Path, PathBuf};

/// Longest line of a comment, in columns.
const WIDTH: usize = 100;

/// First words that mark a fragment, in documentation and in comments inside functions.
const FRAGMENTS: &[&str] = &[
    "As", "Both", "By", "Counted", "From", "How", "Its", "Not", "Nothing", "Of", "So", "Such",
    "Than", "That", "Their", "These", "Those", "What", "Where", "Whether", "Which", "Who", "Whose",
    "Why",
];

/// One comment: consecutive lines with the same comment mark.
pub struct Comment {
    /// File and line.
    pub place: String,
    pub lines: Vec<String>,
    /// Width of the longest line, in columns; lines of example code and of tables do not count.
    pub width: usize,
}

/// Returns the comments of the sources below a folder, except those of tests.
pub fn below(folder: &Path) -> Vec<Comment> {
    let files = sources_below(folder);
    let read =
        |file: &PathBuf| read(&fs::read_to_string(file).unwrap(), &file.display().to_string());
    files.iter().flat_map(read).collect()
}

/// Returns the sources below a folder, except tests, in the order of their names.
pub fn sources_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    sources(folder, &mut files);
    files.sort();
    files
}

fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            files.push(path);
        }
    }
}

/// Returns the comments of a source up to `mod tests`, which is the last item of its file.
pub fn read(text: &str, file: &str) -> Vec<Comment> {
    let mut comments: Vec<Comment> = Vec::new();
    let (mut before, mut is_code) = (None, false);
    for (at, line) in text.lines().enumerate() {
        if line.trim() == "mod tests {" {
            break;
        }
        let marker = ["///", "//!", "//"].into_iter().find(|m| line.trim_start().starts_with(m));
        let key = marker.map(|marker| (marker, line.len() - line.trim_start().len()));
        if key != before {
            is_code = false;
            if key.is_some() {
                let place = format!("{file}:{}", at + 1);
                comments.push(Comment { place, lines: Vec::new(), width: 0 });
            }
        }
        before = key;
        let (Some(marker), Some(comment)) = (marker, comments.last_mut()) else { continue };
        let said = line.trim_start()[marker.len()..].trim();
        if said.starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            if !said.starts_with('|') {
                comment.width = comment.width.max(line.chars().count());
            }
            comment.lines.push(said.to_owned());
        }
    }
    comments
}

impl Comment {
    /// Returns the first word of the comment if it marks a fragment.
    pub fn fragment(&self) -> Option<&str> {
        let first = self.lines.first()?;
        let word = first.split(|c: char| !c.is_alphabetic() && c != '\'').next()?;
        FRAGMENTS.contains(&word).then_some(word)
    }

    /// Returns whether a line is too long.
    pub fn is_wide(&self) -> bool {
        self.width > WIDTH
    }

    /// Returns the first of these phrases that occurs in the comment.
    pub fn phrase<'a>(&self, phrases: &[&'a str]) -> Option<&'a str> {
        let words = self.lines.join(" ").to_lowercase();
        let plain = |c: char| !c.is_alphabetic() && c != '\'';
        let words: Vec<&str> = words.split(plain).filter(|word| !word.is_empty()).collect();
        let has = |phrase: &&&str| {
            let sought: Vec<&str> = phrase.split(' ').collect();
            words.windows(sought.len()).any(|window| window == sought)
        };
        phrases.iter().find(has).copied()
    }
}

/// Returns the phrases of `phrases.txt` in this folder: the text before the first two spaces of
/// each line.
pub fn phrases() -> Vec<&'static str> {
    let lines = include_str!("phrases.txt").lines().filter(|line| !line.starts_with('#'));
    lines.filter_map(|line| line.split("  ").next()).map(str::trim).collect()
}
