//! What records are written with: numbers of variable length, texts, and structs by what changed in them.

/// Bytes that are no record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed;

impl std::fmt::Display for Malformed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the bytes are no record of a journal")
    }
}

impl std::error::Error for Malformed {}

/// Equal bytes between two changed ones that are written all the same: saying how many costs as much.
const SHORT_RUN: usize = 2;

/// Appends a number, seven bits a byte, the lowest first; the top bit says that more follow (LEB128).
pub fn put_number(out: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// Appends a number that may be negative: those near 0 are short, whatever their sign (zigzag).
pub fn put_signed(out: &mut Vec<u8>, number: i64) {
    put_number(out, (number << 1 ^ number >> 63) as u64);
}

/// Appends how many bytes there are, and the bytes.
pub fn put_bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    put_number(out, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

/// Appends how `now` differs from `before`, which is as long: again and again how many bytes are the same, how many are new, and
/// the new ones, until all are said.
pub fn put_changes(out: &mut Vec<u8>, before: &[u8], now: &[u8]) {
    debug_assert_eq!(before.len(), now.len());
    let is_same = |at: usize| before.get(at) == now.get(at);
    let mut at = 0;
    while at < now.len() {
        let same = at;
        while at < now.len() && is_same(at) {
            at += 1;
        }
        let first = at;
        let mut end = at;
        // Up to the last changed byte before a long run of equal ones.
        while at < now.len() && at - end <= SHORT_RUN {
            if !is_same(at) {
                end = at + 1;
            }
            at += 1;
        }
        at = end;
        put_number(out, (first - same) as u64);
        put_bytes(out, &now[first..end]);
    }
}

/// Reads what the functions of this module wrote. Nothing that it gives is longer than what it reads.
#[derive(Clone, Copy, Debug)]
pub struct Cursor<'a> {
    rest: &'a [u8],
}

impl<'a> Cursor<'a> {
    /// At the first byte of `bytes`.
    pub fn new(bytes: &'a [u8]) -> Cursor<'a> {
        Cursor { rest: bytes }
    }

    /// Whether all was read.
    pub fn is_at_end(&self) -> bool {
        self.rest.is_empty()
    }

    /// The bytes that were not read.
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// All bytes that were not read, which then are.
    pub fn take_rest(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.rest)
    }

    /// The next byte.
    ///
    /// # Errors
    /// There is none.
    pub fn byte(&mut self) -> Result<u8, Malformed> {
        Ok(self.take(1)?[0])
    }

    /// The next bytes, so many.
    ///
    /// # Errors
    /// There are fewer.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], Malformed> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(Malformed)?;
        self.rest = rest;
        Ok(taken)
    }

    /// A number of [`put_number`].
    ///
    /// # Errors
    /// There is none, or it has more than 64 bits.
    pub fn number(&mut self) -> Result<u64, Malformed> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7F);
            if bits << shift >> shift != bits {
                return Err(Malformed);
            }
            number |= bits << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(Malformed)
    }

    /// A number of [`put_signed`].
    ///
    /// # Errors
    /// Those of [`Cursor::number`].
    pub fn signed(&mut self) -> Result<i64, Malformed> {
        let number = self.number()?;
        Ok((number >> 1) as i64 ^ -((number & 1) as i64))
    }

    /// A number that counts something in memory, at most `most`.
    ///
    /// # Errors
    /// There is none, or it is larger.
    pub fn count(&mut self, most: usize) -> Result<usize, Malformed> {
        let count = usize::try_from(self.number()?).map_err(|_| Malformed)?;
        if count <= most {
            Ok(count)
        } else {
            Err(Malformed)
        }
    }

    /// The bytes of [`put_bytes`].
    ///
    /// # Errors
    /// There are fewer.
    pub fn bytes(&mut self) -> Result<&'a [u8], Malformed> {
        let count = self.count(usize::MAX)?;
        self.take(count)
    }

    /// Makes of `before` what [`put_changes`] was given as `now`.
    ///
    /// # Errors
    /// It is no such thing; `before` may have changed then.
    pub fn changes(&mut self, before: &mut [u8]) -> Result<(), Malformed> {
        let mut at = 0;
        while at < before.len() {
            let same = self.count(before.len() - at)?;
            let new = self.bytes()?;
            if same + new.len() == 0 {
                return Err(Malformed);
            }
            at += same;
            let place = before
                .get_mut(at..)
                .and_then(|rest| rest.get_mut(..new.len()));
            place.ok_or(Malformed)?.copy_from_slice(new);
            at += new.len();
        }
        Ok(())
    }
}
