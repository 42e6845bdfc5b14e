//! Reading and writing of a checkpoint's archive, a zip of stored entries.

/// Names and contents, in order.
pub(crate) struct Archive(pub Vec<(String, Vec<u8>)>);

/// The little-endian number of `size` bytes at `at`.
fn number(bytes: &[u8], at: usize, size: usize) -> usize {
    bytes[at..at + size]
        .iter()
        .rev()
        .fold(0, |n, b| n << 8 | usize::from(*b))
}

impl Archive {
    pub(crate) fn read(bytes: &[u8]) -> Self {
        let mut entries = Vec::new();
        let mut at = 0;
        while bytes[at..].starts_with(b"PK\x03\x04") {
            let (size, name) = (number(bytes, at + 18, 4), number(bytes, at + 26, 2));
            let start = at + 30 + name + number(bytes, at + 28, 2);
            let name = String::from_utf8_lossy(&bytes[at + 30..at + 30 + name]).into_owned();
            entries.push((name, bytes[start..start + size].to_vec()));
            at = start + size;
        }
        Self(entries)
    }

    pub(crate) fn write(&self) -> Vec<u8> {
        let (mut files, mut directory) = (Vec::new(), Vec::new());
        for (name, content) in &self.0 {
            // From "version needed" to "length of the extra field".
            let mut fields = vec![20, 0, 0, 0, 0, 0, 0, 0, 33, 0];
            fields.extend(crc32(content).to_le_bytes());
            fields.extend([(content.len() as u32).to_le_bytes(); 2].concat());
            fields.extend((name.len() as u32).to_le_bytes());
            directory.extend(b"PK\x01\x02\x14\x00");
            directory.extend(&fields);
            directory.extend([0; 10]);
            directory.extend((files.len() as u32).to_le_bytes());
            directory.extend(name.bytes());
            files.extend(b"PK\x03\x04");
            files.extend(&fields);
            files.extend(name.bytes());
            files.extend(content);
        }
        let (count, start) = (self.0.len() as u16, files.len() as u32);
        files.extend(&directory);
        files.extend(b"PK\x05\x06\0\0\0\0");
        files.extend([count.to_le_bytes(); 2].concat());
        files.extend((directory.len() as u32).to_le_bytes());
        files.extend(start.to_le_bytes());
        files.extend([0; 2]);
        files
    }

    /// Replaces the only occurrence of `old` in the pickle by `new`.
    pub(crate) fn edit_pickle(&mut self, old: &[u8], new: &[u8]) {
        let (name, pickle) = &mut self.0[0];
        assert!(name.ends_with("data.pkl"), "{name}");
        let places: Vec<usize> = (0..pickle.len())
            .filter(|at| pickle[*at..].starts_with(old))
            .collect();
        let [at] = places[..] else {
            panic!("{} places", places.len());
        };
        pickle.splice(at..at + old.len(), new.iter().copied());
    }

    /// Converts all values to two bytes each by `narrow`, and sets the type of their `storage` in
    /// the pickle.
    pub(crate) fn narrow(&mut self, storage: &str, narrow: impl Fn(f32) -> [u8; 2]) {
        self.edit_pickle(b"FloatStorage", storage.as_bytes());
        for (name, content) in &mut self.0 {
            if name.contains("/data/") {
                let (numbers, _) = content.as_chunks::<4>();
                let narrowed = numbers.iter().flat_map(|b| narrow(f32::from_le_bytes(*b)));
                *content = narrowed.collect();
            }
        }
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            crc >> 1 ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}
