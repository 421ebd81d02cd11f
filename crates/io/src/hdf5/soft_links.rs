//! Soft links in groups of the format before HDF5 1.8.
//!
//! The decoder expects an object behind each entry of such a group. A soft link has no object, so
//! that a single soft link makes all members of its group unreadable. The entries of soft links are
//! therefore removed first, in memory.
//!
//! # Source
//! The HDF Group, *HDF5 File Format Specification*, version 3, sections III.B (Disk Format: Level
//! 1B – Group Symbol Table Nodes) and III.C (Symbol Table Entry).

use memchr::memmem;

/// Start of a node: its signature, version 1, and a reserved byte.
const START: &[u8] = b"SNOD\x01\0";

/// Number of bytes of a node before its entries: those of `START`, and two for the number of
/// entries.
const HEADER: usize = 8;

/// Number of bytes of an entry whose addresses have eight bytes.
const ENTRY: usize = 40;

/// Offset, within an entry, of the address of its object; `KIND` is the offset of the kind of the
/// entry.
const ADDRESS: usize = 8;
const KIND: usize = 16;

/// Address of an object that does not exist.
const UNDEFINED: [u8; 8] = [0xff; 8];

/// Kind of an entry that is a soft link.
const SOFT_LINK: [u8; 4] = 2_u32.to_le_bytes();

/// Removes the soft links from the groups of a file whose addresses have eight bytes.
pub(super) fn remove(bytes: &mut [u8]) {
    let nodes: Vec<usize> = memmem::find_iter(bytes, START).collect();
    for node in nodes {
        let Some((header, entries)) = bytes[node..].split_at_mut_checked(HEADER) else { continue };
        let count = usize::from(u16::from_le_bytes([header[6], header[7]]));
        let Some(entries) = entries.get_mut(..count * ENTRY) else { continue };
        let mut objects: u16 = 0;
        for number in 0..count {
            let entry = number * ENTRY..(number + 1) * ENTRY;
            if !is_soft_link(&entries[entry.clone()]) {
                entries.copy_within(entry, usize::from(objects) * ENTRY);
                objects += 1;
            }
        }
        header[6..].copy_from_slice(&objects.to_le_bytes());
    }
}

fn is_soft_link(entry: &[u8]) -> bool {
    entry[ADDRESS..KIND] == UNDEFINED && entry[KIND..KIND + SOFT_LINK.len()] == SOFT_LINK
}
