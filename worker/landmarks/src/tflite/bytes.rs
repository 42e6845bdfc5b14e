//! Tables of a flatbuffer: every access is checked against the file's length.

/// Most numbers in a short list: a tensor's shape, or the tensors of an operator or of a graph's inputs and outputs.
const FEW: usize = 64;

/// A table in a flatbuffer: its offset, with the whole file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// A vector in a flatbuffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vector<'a> {
    bytes: &'a [u8],
    /// Offset of the first element.
    at: usize,
    len: usize,
}

fn read<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    read(bytes, at).map(u32::from_le_bytes)
}

/// The target of the relative offset at `at`; `None` if it is outside the file.
fn follow(bytes: &[u8], at: usize) -> Option<usize> {
    let to = at.checked_add(u32_at(bytes, at)? as usize)?;
    (to < bytes.len()).then_some(to)
}

impl<'a> Table<'a> {
    /// The root table, at the file's first offset.
    pub(super) fn root(bytes: &'a [u8]) -> Option<Self> {
        let at = follow(bytes, 0)?;
        Some(Self { bytes, at })
    }

    /// Offset of field `number`; `None` if the field has its default, or the table is outside the file.
    fn field(&self, number: usize) -> Option<usize> {
        let back = i64::from(read(self.bytes, self.at).map(i32::from_le_bytes)?);
        let vtable = usize::try_from(i64::try_from(self.at).ok()?.checked_sub(back)?).ok()?;
        let length = usize::from(read(self.bytes, vtable).map(u16::from_le_bytes)?);
        let entry = 4 + 2 * number;
        if entry + 2 > length {
            return None;
        }
        let offset = usize::from(read(self.bytes, vtable + entry).map(u16::from_le_bytes)?);
        (offset != 0).then(|| self.at + offset)
    }

    pub(super) fn u8(&self, number: usize) -> Option<u8> {
        self.bytes.get(self.field(number)?).copied()
    }

    pub(super) fn u32(&self, number: usize) -> Option<u32> {
        u32_at(self.bytes, self.field(number)?)
    }

    pub(super) fn i32(&self, number: usize) -> Option<i32> {
        read(self.bytes, self.field(number)?).map(i32::from_le_bytes)
    }

    pub(super) fn table(&self, number: usize) -> Option<Table<'a>> {
        let at = follow(self.bytes, self.field(number)?)?;
        Some(Table {
            bytes: self.bytes,
            at,
        })
    }

    /// The vector of field `number` with elements of `width` bytes; `None` if it is absent or reaches beyond the file.
    pub(super) fn vector(&self, number: usize, width: usize) -> Option<Vector<'a>> {
        let start = follow(self.bytes, self.field(number)?)?;
        let len = u32_at(self.bytes, start)? as usize;
        let end = start + 4 + len.checked_mul(width)?;
        (end <= self.bytes.len()).then_some(Vector {
            bytes: self.bytes,
            at: start + 4,
            len,
        })
    }

    /// The 32-bit numbers of field `number`, at most a few; empty if the field is absent. Many tables may share one long
    /// list, so without a limit a short file could fill the memory.
    pub(super) fn i32s(&self, number: usize) -> Result<Vec<i32>, String> {
        let vector = self.vector(number, 4);
        match vector {
            Some(vector) if vector.len() > FEW => {
                Err(format!("a list of {}: {FEW} are allowed", vector.len()))
            }
            vector => Ok(vector.map(|vector| vector.i32s()).unwrap_or_default()),
        }
    }
}

impl<'a> Vector<'a> {
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The elements of a vector of bytes.
    pub(super) fn raw(&self) -> &'a [u8] {
        self.bytes
            .get(self.at..self.at + self.len)
            .unwrap_or_default()
    }

    /// The element `index` of a vector of tables.
    pub(super) fn table(&self, index: usize) -> Option<Table<'a>> {
        if index >= self.len {
            return None;
        }
        let at = follow(self.bytes, self.at + 4 * index)?;
        Some(Table {
            bytes: self.bytes,
            at,
        })
    }

    pub(super) fn tables(self) -> impl Iterator<Item = Option<Table<'a>>> {
        (0..self.len).map(move |index| self.table(index))
    }

    /// The elements of a vector of 32-bit numbers.
    pub(super) fn i32s(&self) -> Vec<i32> {
        let at = |index| read(self.bytes, self.at + 4 * index).map(i32::from_le_bytes);
        (0..self.len).map_while(at).collect()
    }

    /// The elements of a vector of 16-bit numbers.
    pub(super) fn u16s(&self) -> Vec<u16> {
        let at = |index| read(self.bytes, self.at + 2 * index).map(u16::from_le_bytes);
        (0..self.len).map_while(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table with field 0 absent, field 1 = 7 (u8), field 2 = [1, -2] (i32).
    fn small() -> Vec<u8> {
        let mut bytes = vec![16, 0, 0, 0]; // Offset of the root.
        bytes.extend([10, 0, 12, 0, 0, 0, 4, 0, 8, 0]); // Vtable: sizes, then three fields.
        bytes.extend([0, 0]); // Padding up to 16.
        bytes.extend(12i32.to_le_bytes()); // Back to the vtable at 4.
        bytes.extend([7, 0, 0, 0]);
        bytes.extend(4u32.to_le_bytes()); // The vector is at 28.
        bytes.extend(2u32.to_le_bytes());
        bytes.extend(1i32.to_le_bytes());
        bytes.extend((-2i32).to_le_bytes());
        bytes
    }

    #[test]
    fn fields_are_found_by_the_vtable() {
        let bytes = small();
        let table = Table::root(&bytes).expect("a root");
        assert_eq!(table.u8(0), None);
        assert_eq!(table.u8(1), Some(7));
        assert_eq!(table.i32s(2).expect("a short list"), [1, -2]);
        assert_eq!(table.u8(3), None, "beyond the vtable");
    }

    #[test]
    fn vectors_beyond_the_file_are_absent() {
        let mut bytes = small();
        bytes[28..32].copy_from_slice(&u32::MAX.to_le_bytes());
        let table = Table::root(&bytes).expect("a root");
        assert!(table.vector(2, 4).is_none());
        for length in 0..bytes.len() {
            if let Some(table) = Table::root(&bytes[..length]) {
                let _ = table.i32s(2);
                table.u8(1);
            }
        }
    }
}
