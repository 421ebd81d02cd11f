//! Check of the footer of a file, before the decoder allocates the memory that the footer states.
//!
//! The decoder reserves memory for every child that an element of the schema claims, and recurses
//! into nested elements without a limit: two kilobytes can claim gigabytes, or exhaust the stack.
//!
//! # Source
//! Apache Parquet format, `FileMetaData` and `SchemaElement`.

use ::parquet::file::reader::ChunkReader;

use super::thrift::Bytes;

/// Maximum depth of nested groups in a schema; deeper schemas are refused as forged. A table of
/// numbers has one level, its root; a column of lists has three.
const GROUP_DEPTH: usize = 64;

/// Number of bytes at the end of a file: length of the footer, and magic word.
const TAIL: u64 = 8;

/// Field of `FileMetaData` with the schema.
const SCHEMA: i64 = 2;

/// Field of `SchemaElement` with the number of children.
const CHILDREN: i64 = 5;

/// Kind of a list in the compact protocol.
const LIST: u8 = 9;

/// Kind of a struct in the compact protocol.
const STRUCT: u8 = 12;

/// Returns whether the footer of a file is plausible; `true` for a file too short to have one,
/// which the decoder refuses.
pub fn is_possible(source: &impl ChunkReader) -> bool {
    let Some(start) = source.len().checked_sub(TAIL) else { return true };
    let Ok(tail) = source.get_bytes(start, TAIL as usize) else { return true };
    let Some(len) = tail.first_chunk::<4>().map(|word| u32::from_le_bytes(*word)) else {
        return true;
    };
    let Some(start) = start.checked_sub(u64::from(len)) else { return true };
    source.get_bytes(start, len as usize).is_ok_and(|footer| is_possible_schema(&footer))
}

/// Parses a footer; `false` if a list has more elements than the footer has remaining bytes, or if
/// the schema is not a tree.
fn is_possible_schema(footer: &[u8]) -> bool {
    let walked = Bytes(footer).fields(|bytes, field, kind| match (field, kind) {
        (SCHEMA, LIST) => {
            let (kind, count) = bytes.list()?;
            // Every element needs at least one byte.
            if kind != STRUCT || count > bytes.0.len() as u64 {
                return None;
            }
            let mut tree = Tree::new(count);
            (0..count).try_for_each(|_| tree.push(bytes.number_of(CHILDREN)?.unwrap_or(0)))
        }
        _ => bytes.skip(kind, 0),
    });
    walked.is_some()
}

/// Check of a tree whose elements, in depth-first order, state the number of their children.
struct Tree {
    /// Number of elements still to come.
    rest: u64,
    /// Number of children still to come of each open group, the innermost last.
    open: Vec<u64>,
}

impl Tree {
    fn new(elements: u64) -> Self {
        Self { rest: elements, open: Vec::new() }
    }

    /// Adds an element; `None` if fewer elements follow than this element has children, or if the
    /// nesting is too deep.
    fn push(&mut self, children: i64) -> Option<()> {
        self.rest -= 1;
        let children = u64::try_from(children).ok().filter(|count| *count <= self.rest)?;
        while self.open.last() == Some(&0) {
            self.open.pop();
        }
        if let Some(siblings) = self.open.last_mut() {
            *siblings -= 1;
        }
        if children > 0 {
            self.open.push(children);
        }
        (self.open.len() <= GROUP_DEPTH).then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a footer whose schema has elements with these numbers of children.
    fn footer(children: &[u32]) -> Vec<u8> {
        let varint = |mut value: u32| {
            let mut bytes = Vec::new();
            while value >= 0x80 {
                bytes.push(value as u8 | 0x80);
                value >>= 7;
            }
            bytes.push(value as u8);
            bytes
        };
        // The footer begins with the version; the list of structs follows.
        let mut bytes = vec![0x15, 0x02, 0x19, 0xfc];
        bytes.extend(varint(children.len() as u32));
        for count in children {
            bytes.push(0x55);
            bytes.extend(varint(count << 1));
            bytes.push(0);
        }
        bytes.push(0);
        bytes
    }

    #[test]
    fn schemas_are_trees_with_as_many_children_as_they_state() {
        assert!(is_possible_schema(&footer(&[2, 0, 0])));
        assert!(is_possible_schema(&footer(&[2, 1, 0, 2, 0, 0])));
        assert!(!is_possible_schema(&footer(&[3, 0, 0])));
        assert!(!is_possible_schema(&footer(&[0x7fff_ffff, 0, 0])));
        let nested = |depth: usize| [vec![1; depth], vec![0]].concat();
        assert!(is_possible_schema(&footer(&nested(GROUP_DEPTH))));
        assert!(!is_possible_schema(&footer(&nested(GROUP_DEPTH + 1))));
        // The list states more elements than the footer has bytes.
        assert!(!is_possible_schema(&[0x19, 0xfc, 0xff, 0xff, 0xff, 0x7f, 0x00]));
        let whole = footer(&[2, 0, 0]);
        (1..whole.len()).for_each(|len| assert!(!is_possible_schema(&whole[..len]), "{len}"));
    }
}
