//! A search for what may be left of a person in files: pieces of their tensors, of their moments, their grid and
//! their pose track, names and numbers of their parameters, and the measures of their body.

use super::super::TrainError;
use super::super::checkpoint::ModelState;
use super::super::refinement_file;
use super::rewrite::{failed, ids, is_occupancy_of, own_tensors, read};
use aho_corasick::AhoCorasick;
use burn::tensor::Bytes;
use burn_pack::Reader;
use safetensors::SafeTensors;
use std::collections::{BTreeSet, HashSet};
use std::path::Path;
use yoto_capture::skeleton::Skeleton;
use yoto_proto::manifest::files;

/// Length of a piece, bytes: eight numbers.
const PIECE: usize = 32;
/// Fewest different bytes in a piece that only one tensor has: zeros are everywhere.
const DISTINCT: usize = 14;
/// Most pieces of a tensor or file.
const PIECES: usize = 16;
/// Leading characters of a number's text that tell a body: the last digits may be written otherwise.
const DIGITS: usize = 12;

/// What a person left in a checkpoint, to be searched for in others.
pub struct Residue {
    whats: Vec<String>,
    pieces: Vec<Vec<u8>>,
}

/// A trace of a person.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Name of the file.
    pub file: String,
    /// What of theirs is in it.
    pub what: String,
}

impl Residue {
    /// What is of the person in `slot` in the checkpoint in `from` with this `state`.
    ///
    /// # Errors
    /// If a file can't be read.
    pub fn of(from: &Path, state: &ModelState, slot: usize) -> Result<Self, TrainError> {
        let mut residue = Self {
            whats: Vec::new(),
            pieces: Vec::new(),
        };
        let path = from.join(files::WEIGHTS);
        let bytes = std::fs::read(&path).map_err(|e| failed(&path, e))?;
        let tensors = SafeTensors::deserialize(&bytes).map_err(|e| failed(&path, e))?;
        let names = own_tensors(from, slot)?;
        for name in &names {
            let tensor = tensors.tensor(name).map_err(|e| failed(&path, e))?;
            residue.cut(name, tensor.data());
            residue.add(
                format!("the name {name}"),
                format!("\"{name}\"").into_bytes(),
            );
        }
        residue.moments(from, &names)?;
        let path = from.join(files::OCCUPANCY);
        if let Some(bytes) = read(&path)? {
            let grids = SafeTensors::deserialize(&bytes).map_err(|e| failed(&path, e))?;
            for (name, grid) in grids.iter().filter(|(name, _)| is_occupancy_of(name, slot)) {
                residue.cut(&format!("the occupancy {name}"), grid.data());
            }
        }
        let track = files::refined_poses(slot);
        if let Some(bytes) = read(&from.join(&track))? {
            // All tracks name the same joints, and one camera may have filmed them all.
            let others = refinement_file::others(from, &[])?;
            let others = others.iter().filter(|(other, _)| *other != slot);
            let others: Vec<&[u8]> = others.map(|(_, file)| &**file).collect();
            residue.cut_where_unlike(&track, &bytes, &others);
        }
        residue.body(state, slot);
        Ok(residue)
    }

    /// Number of traces that are searched for.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Whether there is nothing to search for.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Everything that is in the files of the folder `dir`, once per file and trace.
    ///
    /// # Errors
    /// If a file can't be read.
    pub fn search(&self, dir: &Path) -> Result<Vec<Finding>, TrainError> {
        let seeker = AhoCorasick::new(&self.pieces).map_err(|e| failed(dir, e))?;
        let mut found = Vec::new();
        for entry in std::fs::read_dir(dir).map_err(|e| failed(dir, e))? {
            let path = entry.map_err(|e| failed(dir, e))?.path();
            let bytes = std::fs::read(&path).map_err(|e| failed(&path, e))?;
            let hits = seeker.find_overlapping_iter(&bytes);
            let hits: BTreeSet<usize> = hits.map(|hit| hit.pattern().as_usize()).collect();
            let file = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            found.extend(hits.into_iter().map(|hit| Finding {
                file: file.clone(),
                what: self.whats[hit].clone(),
            }));
        }
        Ok(found)
    }

    /// Pieces of the moments of the parameters with these `names`, and their numbers.
    fn moments(&mut self, from: &Path, names: &[String]) -> Result<(), TrainError> {
        let path = from.join(files::OPTIMISER);
        let Some(bytes) = read(&path)? else {
            return Ok(());
        };
        let theirs = ids(names.iter().map(String::as_str));
        let mut seen = BTreeSet::new();
        let reader = Reader::from_bytes(Bytes::from_bytes_vec(bytes));
        let tensors = reader.and_then(Reader::into_tensors);
        for tensor in tensors.map_err(|e| failed(&path, e))? {
            let (name, _, _, id, bytes) = tensor.into_parts().map_err(|e| failed(&path, e))?;
            if let Some(id) = id.filter(|id| theirs.contains(id)) {
                seen.insert(id);
                self.cut(&format!("the moment {name}"), &bytes);
            }
        }
        for id in seen {
            self.add(format!("the number {id}"), id.to_string().into_bytes());
        }
        Ok(())
    }

    /// Measures of the person's body that nobody else's has, as the state writes them.
    fn body(&mut self, state: &ModelState, slot: usize) {
        let texts = |skeleton: &Skeleton| -> BTreeSet<String> {
            let numbers = skeleton.rest.iter().flatten();
            let texts = numbers.filter_map(|number| serde_json::to_string(&number.abs()).ok());
            let texts = texts.filter_map(|text| Some(text.get(..DIGITS)?.to_owned()));
            texts.collect()
        };
        let others = state
            .slots
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != slot);
        let others: BTreeSet<String> = others
            .filter_map(|(_, skeleton)| skeleton.as_ref())
            .flat_map(texts)
            .collect();
        let practice = state.practice.get(slot);
        if let Some(loss) = practice.and_then(|practice| practice.loss)
            && let Ok(text) = serde_json::to_string(&loss)
        {
            self.add("the loss".to_owned(), text.into_bytes());
        }
        if let Some(Some(skeleton)) = state.slots.get(slot) {
            for text in texts(skeleton).difference(&others) {
                self.add(format!("the measure {text}"), text.clone().into_bytes());
            }
        }
    }

    /// Adds pieces from all over `bytes`.
    fn cut(&mut self, what: &str, bytes: &[u8]) {
        self.cut_where_unlike(what, bytes, &[]);
    }

    /// Adds pieces from all over `bytes` that none of the `others` has.
    fn cut_where_unlike(&mut self, what: &str, bytes: &[u8], others: &[&[u8]]) {
        let telling = |piece: &&[u8]| piece.iter().collect::<BTreeSet<_>>().len() >= DISTINCT;
        let known: HashSet<&[u8]> = others.iter().flat_map(|it| it.windows(PIECE)).collect();
        let pieces = bytes.chunks_exact(PIECE).filter(telling);
        let pieces: Vec<&[u8]> = pieces.filter(|piece| !known.contains(piece)).collect();
        let apart = pieces.len().div_ceil(PIECES).max(1);
        for piece in pieces.into_iter().step_by(apart) {
            self.add(format!("a piece of {what}"), piece.to_vec());
        }
    }

    fn add(&mut self, what: String, piece: Vec<u8>) {
        self.whats.push(what);
        self.pieces.push(piece);
    }
}
