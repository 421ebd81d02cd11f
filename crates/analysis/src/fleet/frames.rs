//! Messages between a fleet and its worker processes: a length of four bytes (little endian), then
//! the bytes of the message.

use std::io::{self, ErrorKind, Read, Write};

/// Maximum number of bytes of a message; the row of a record takes some thousand bytes.
const LONGEST: usize = 1 << 28;

/// Writes a message.
pub fn write(into: &mut impl Write, message: &[u8]) -> io::Result<()> {
    let len = u32::try_from(message.len()).map_err(io::Error::other)?;
    into.write_all(&len.to_le_bytes())?;
    into.write_all(message)?;
    into.flush()
}

/// Reads a message; `None` at the end of the stream.
pub fn read(from: &mut impl Read) -> io::Result<Option<Vec<u8>>> {
    let mut len = [0; 4];
    match from.read_exact(&mut len) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(None),
        Err(error) => return Err(error),
    }
    let len = u32::from_le_bytes(len) as usize;
    if len > LONGEST {
        return Err(io::Error::other("a message is too long"));
    }
    let mut message = vec![0; len];
    from.read_exact(&mut message)?;
    Ok(Some(message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_as_they_were_written() {
        let mut pipe = Vec::new();
        for message in [&b"abc"[..], b"", b"\0\x01"] {
            write(&mut pipe, message).unwrap();
        }
        let mut rest = pipe.as_slice();
        assert_eq!(read(&mut rest).unwrap().unwrap(), b"abc");
        assert_eq!(read(&mut rest).unwrap().unwrap(), b"");
        assert_eq!(read(&mut rest).unwrap().unwrap(), b"\0\x01");
        assert_eq!(read(&mut rest).unwrap(), None);
        // The first message is cut off, and the second has an impossible length.
        assert!(read(&mut &pipe[..6]).is_err());
        assert!(read(&mut &[0xff; 8][..]).is_err());
    }
}
