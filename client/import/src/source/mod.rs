//! The files of a capture, and access to the plain data in them with errors that name file, frame
//! and field.

mod faulty;
mod finite;
#[cfg(feature = "hdf5")]
pub(crate) mod hdf5;
mod json;
mod rows;

pub(crate) use faulty::{FEW, Faulty, is_number};
pub(crate) use finite::not_finite;

use crate::ImportError;
use std::path::{Path, PathBuf};
use yoto_formats::{Array, Value, npy, npz, pickle, torch};
use yoto_proto::pose_track::violation;
use yoto_proto::v1::Violation;

/// Largest file of poses or cameras, bytes; body models with 300 shapes take 250 million.
const MAX_BYTES: u64 = 1 << 30;
/// Parts of a file that no importer reads. They may be many times larger than the rest.
const UNREAD: [&str; 2] = ["verts", "vertices"];

/// The folder of a capture.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    root: PathBuf,
}

impl Source {
    pub(crate) fn new(root: &Path) -> Self {
        Self {
            root: root.to_owned(),
        }
    }

    /// Path of a file of the capture on this disk.
    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.root.join(name)
    }

    pub(crate) fn has(&self, name: impl AsRef<Path>) -> bool {
        self.path(name).exists()
    }

    /// An error of the capture.
    pub(crate) fn bad(&self, violations: Vec<Violation>) -> ImportError {
        ImportError::BadCapture {
            place: self.root.display().to_string(),
            violations,
        }
    }

    /// An error about one violation.
    pub(crate) fn fault(
        &self,
        code: &str,
        file: &str,
        frame: Option<u32>,
        field: impl Into<String>,
        message: impl Into<String>,
    ) -> ImportError {
        self.bad(vec![violation(code, file, frame, field, message)])
    }

    /// The bytes of a file.
    pub(crate) fn bytes(&self, file: &str, frame: Option<u32>) -> Result<Vec<u8>, ImportError> {
        let path = self.path(file);
        let size = match path.metadata() {
            Ok(meta) if meta.is_file() => meta.len(),
            Ok(_) => return Err(self.fault("MISSING", file, frame, "", "this is not a file")),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(self.fault("MISSING", file, frame, "", "there is no such file"));
            }
            Err(error) => return Err(ImportError::file("reading", path)(error)),
        };
        if size > MAX_BYTES {
            let message = format!("{size} bytes are more than the limit of {MAX_BYTES}");
            return Err(self.fault("TOO_LARGE", file, frame, "", message));
        }
        std::fs::read(&path).map_err(ImportError::file("reading", path))
    }

    /// The data of a file, by its extension: `.npy`, `.npz`, `.json`, `.pt` and `.pth` of torch, and
    /// pickles and files of joblib under any other.
    pub(crate) fn data(&self, file: &str, frame: Option<u32>) -> Result<FileData<'_>, ImportError> {
        let bytes = self.bytes(file, frame)?;
        let value = match Path::new(file).extension().and_then(|e| e.to_str()) {
            Some("npy") => npy::read(&bytes).map_err(|e| e.to_string()),
            Some("npz") => npz::read(&bytes, MAX_BYTES).map_err(|e| e.to_string()),
            Some("json") => json::read(&bytes),
            // Some programs write joblib's files under torch's endings.
            Some("pt" | "pth") => torch::read(&bytes, MAX_BYTES).or_else(|error| {
                pickle::read_without(&bytes, &UNREAD).map_err(|_| error.to_string())
            }),
            _ => pickle::read_without(&bytes, &UNREAD).map_err(|e| e.to_string()),
        };
        let value = value.map_err(|message| self.fault("UNREADABLE", file, frame, "", message))?;
        Ok(FileData {
            source: self,
            file: file.to_owned(),
            frame,
            value,
        })
    }

    /// Names of the files in a folder that end in one of `endings` (lower case), in order.
    pub(crate) fn list(&self, folder: &str, endings: &[&str]) -> Result<Vec<String>, ImportError> {
        let path = self.path(folder);
        let entries = match std::fs::read_dir(&path) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(self.fault("MISSING", folder, None, "", "there is no such folder"));
            }
            Err(error) => return Err(ImportError::file("listing", path)(error)),
        };
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry.map_err(ImportError::file("listing", path.clone()))?;
            // A pose track can't refer to a name that is not text.
            let Ok(name) = entry.file_name().into_string() else {
                let name = entry.file_name().to_string_lossy().into_owned();
                let message = "the file's name is not UTF-8";
                return Err(self.fault("BAD_NAME", &name, None, "", message));
            };
            let lower = name.to_ascii_lowercase();
            if endings.iter().any(|ending| lower.ends_with(ending)) {
                names.push(format!("{folder}/{name}"));
            }
        }
        names.sort();
        Ok(names)
    }
}

/// The data of a file.
#[derive(Debug)]
pub(crate) struct FileData<'a> {
    source: &'a Source,
    file: String,
    frame: Option<u32>,
    value: Value,
}

impl FileData<'_> {
    pub(crate) fn root(&self) -> Part<'_> {
        Part {
            data: self,
            frame: self.frame,
            field: String::new(),
            value: &self.value,
            row: None,
        }
    }
}

/// A part of a file's data, with its location.
#[derive(Clone, Debug)]
pub(crate) struct Part<'a> {
    data: &'a FileData<'a>,
    frame: Option<u32>,
    field: String,
    value: &'a Value,
    /// If set, all arrays below are replaced by this row of their first axis.
    row: Option<usize>,
}

impl<'a> Part<'a> {
    fn below(&self, field: String, value: &'a Value) -> Self {
        Self {
            data: self.data,
            frame: self.frame,
            field,
            value,
            row: self.row,
        }
    }

    /// This part, with each array replaced by its row `at` on the first axis.
    pub(crate) fn row(self, at: usize) -> Self {
        Self {
            row: Some(at),
            ..self
        }
    }

    /// This part, located in `frame`.
    pub(crate) fn of_frame(self, frame: u32) -> Self {
        Self {
            frame: Some(frame),
            ..self
        }
    }

    /// An error about this part.
    pub(crate) fn fault(&self, code: &str, message: impl Into<String>) -> ImportError {
        self.data
            .source
            .fault(code, &self.data.file, self.frame, &*self.field, message)
    }

    fn wrong(&self, wanted: &str) -> ImportError {
        let message = format!("{} instead of {wanted}", self.value.kind());
        self.fault("SIZE_MISMATCH", message)
    }

    /// The value of a key, if there is one.
    pub(crate) fn find(&self, key: &str) -> Option<Self> {
        let value = self.value.get(key)?;
        let field = if self.field.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.field)
        };
        Some(self.below(field, value))
    }

    /// The value of a key.
    pub(crate) fn get(&self, key: &str) -> Result<Self, ImportError> {
        self.find(key)
            .ok_or_else(|| self.fault("MISSING", format!("there is no '{key}'")))
    }

    /// Item `at` of a list.
    pub(crate) fn at(&self, at: usize) -> Result<Self, ImportError> {
        let items = self.value.items().ok_or_else(|| self.wrong("a list"))?;
        let item = items.get(at);
        let value = item.ok_or_else(|| {
            let message = format!("there is no item {at}: there are {}", items.len());
            self.fault("MISSING", message)
        })?;
        Ok(self.below(format!("{}[{at}]", self.field), value))
    }

    /// Number of items of a list.
    pub(crate) fn len(&self) -> Result<usize, ImportError> {
        let items = self.value.items();
        items.map(<[_]>::len).ok_or_else(|| self.wrong("a list"))
    }

    /// Keys (texts) and values of a dictionary, in the order of the keys.
    pub(crate) fn entries(&self) -> Result<Vec<(&'a str, Self)>, ImportError> {
        let entries = self.value.entries();
        let entries = entries.ok_or_else(|| self.wrong("a dictionary"))?;
        let mut parts = Vec::with_capacity(entries.len());
        for (key, value) in entries {
            let key = key.text().ok_or_else(|| self.wrong("text keys"))?;
            parts.push((key, self.below(key.to_owned(), value)));
        }
        parts.sort_by_key(|(key, _)| *key);
        if let Some([(key, part), _]) = parts.windows(2).find(|two| two[0].0 == two[1].0) {
            return Err(part.fault("DUPLICATE", format!("'{key}' is repeated")));
        }
        Ok(parts)
    }

    /// Keys and values of a dictionary whose keys are texts or whole numbers, in the file's order.
    pub(crate) fn members(&self) -> Result<Vec<(String, Self)>, ImportError> {
        let entries = self.value.entries();
        let entries = entries.ok_or_else(|| self.wrong("a dictionary"))?;
        let mut parts = Vec::with_capacity(entries.len());
        for (key, value) in entries {
            let number = key.numbers().filter(|key| key.values.len() == 1);
            let name = match (key.text(), number) {
                (Some(text), _) => text.to_owned(),
                (None, Some(number)) => number.values.iter().map(f64::to_string).collect(),
                (None, None) => return Err(self.wrong("keys that are texts or numbers")),
            };
            let field = if self.field.is_empty() {
                name.clone()
            } else {
                format!("{}.{name}", self.field)
            };
            parts.push((name, self.below(field, value)));
        }
        Ok(parts)
    }

    /// The data itself.
    pub(crate) fn value(&self) -> &'a Value {
        self.value
    }

    /// Whether this is Python's `None`.
    pub(crate) fn is_nothing(&self) -> bool {
        matches!(self.value, Value::Nothing)
    }

    /// Whether this is a list.
    pub(crate) fn is_list(&self) -> bool {
        self.value.items().is_some()
    }

    pub(crate) fn text(&self) -> Result<&'a str, ImportError> {
        self.value.text().ok_or_else(|| self.wrong("text"))
    }

    /// An array of numbers, finite or not.
    pub(crate) fn unchecked(&self) -> Result<Array, ImportError> {
        let array = self.value.numbers();
        let array = array.ok_or_else(|| self.wrong("an array of numbers"))?;
        match self.row {
            None => Ok(array),
            Some(at) => array.row(at).ok_or_else(|| {
                self.fault(
                    "MISSING",
                    format!("there is no row {at}: the shape is {:?}", array.shape),
                )
            }),
        }
    }

    /// An array of finite numbers.
    pub(crate) fn array(&self) -> Result<Array, ImportError> {
        let array = self.unchecked()?;
        match array.values.iter().position(|value| !is_number(*value)) {
            None => Ok(array),
            Some(at) => {
                let value = array.values.get(at).copied().unwrap_or(f64::NAN);
                let code = if value.is_finite() {
                    "OUT_OF_RANGE"
                } else {
                    "NOT_FINITE"
                };
                let part = self.below(format!("{}[{at}]", self.field), self.value);
                Err(part.fault(code, format!("{value} is not a finite number")))
            }
        }
    }

    /// `N` numbers, ignoring axes of extent 1.
    pub(crate) fn fixed<const N: usize>(&self) -> Result<[f64; N], ImportError> {
        let array = self.array()?;
        array.fixed().ok_or_else(|| self.wrong(&format!("[{N}]")))
    }

    /// A number, ignoring axes of extent 1.
    pub(crate) fn number(&self) -> Result<f64, ImportError> {
        match self.array()?.values[..] {
            [number] => Ok(number),
            _ => Err(self.wrong("a number")),
        }
    }

    /// Any number of numbers in a row.
    pub(crate) fn vector(&self) -> Result<Vec<f64>, ImportError> {
        let array = self.array()?;
        if array.shape.iter().filter(|side| **side != 1).count() > 1 {
            return Err(self.wrong("a row of numbers"));
        }
        Ok(array.values)
    }

    /// `[any, N]`.
    pub(crate) fn rows<const N: usize>(&self) -> Result<Vec<[f64; N]>, ImportError> {
        let array = self.array()?;
        array.rows().ok_or_else(|| self.wrong(&format!("[…, {N}]")))
    }

    /// `[R, C]`.
    pub(crate) fn matrix<const R: usize, const C: usize>(
        &self,
    ) -> Result<[[f64; C]; R], ImportError> {
        let array = self.array()?;
        array
            .matrix()
            .ok_or_else(|| self.wrong(&format!("[{R}, {C}]")))
    }
}
