//! A search for what may be left of a person in files: pieces of their tensors, of their moments, their grid and
//! their pose track, names and numbers of their parameters, and the measures of their body.

use super::rewrite::{failed, ids, is_occupancy_of, own_tensors, read};
use crate::train::TrainError;
use crate::train::poses::refinement_file;
use crate::train::run::checkpoint::ModelState;
use aho_corasick::AhoCorasick;
use burn::tensor::Bytes;
use burn_pack::Reader;
use safetensors::SafeTensors;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::Path;
use yoto_capture::skeleton::Skeleton;
use yoto_proto::manifest::files;

/// Length of a piece, bytes: eight numbers.
const PIECE: usize = 32;
/// Fewest different bytes in a piece that only one tensor has: zeros are everywhere.
const DISTINCT: usize = 14;
/// Most pieces of a tensor or file.
const PIECES: usize = 16;
/// Pieces that are tried for each one that is kept: those that anybody else has are no evidence.
const CANDIDATES: usize = 8;
/// Leading characters of a number's text that tell a body: the last digits may be written otherwise.
const DIGITS: usize = 12;

/// Traces of a person in a checkpoint, to be searched for in others.
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
    /// The traces of the person in `slot` in the checkpoint in `from` with this `state`.
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
        let mut data = Data::default();
        for (name, tensor) in tensors.iter() {
            let theirs = names.iter().any(|it| it == name);
            data.add(theirs, || name.to_owned(), tensor.data());
        }
        for name in &names {
            residue.add(
                format!("the name {name}"),
                format!("\"{name}\"").into_bytes(),
            );
        }
        residue.moments(from, &names, &mut data)?;
        let path = from.join(files::OCCUPANCY);
        let occupancy = read(&path)?;
        if let Some(bytes) = &occupancy {
            let grids = SafeTensors::deserialize(bytes).map_err(|e| failed(&path, e))?;
            for (name, grid) in grids.iter() {
                let theirs = is_occupancy_of(name, slot);
                data.add(theirs, || format!("the occupancy {name}"), grid.data());
            }
        }
        let track = files::refined_poses(slot);
        if let Some(bytes) = read(&from.join(&track))? {
            data.add(true, || track, bytes);
        }
        // All tracks name the same joints, and one camera may have filmed them all.
        for (other, file) in refinement_file::others(from, &[])? {
            if other != slot {
                data.add(false, String::new, file);
            }
        }
        residue.cut(&data).map_err(|e| failed(from, e))?;
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

    /// Adds the moments of all parameters to `data`. Those with these `names` are the person's, and
    /// their numbers are searched for.
    fn moments(
        &mut self,
        from: &Path,
        names: &[String],
        data: &mut Data<'_>,
    ) -> Result<(), TrainError> {
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
            let id = id.filter(|id| theirs.contains(id));
            data.add(
                id.is_some(),
                || format!("the moment {name}"),
                bytes.to_vec(),
            );
            seen.extend(id);
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
        if let Some(Some(skeleton)) = state.slots.get(slot) {
            for text in texts(skeleton).difference(&others) {
                self.add(format!("the measure {text}"), text.clone().into_bytes());
            }
        }
    }

    /// Adds pieces from all over the person's data that nobody else's data has.
    ///
    /// Moments of two people can be equal: a parameter whose gradients were the same for both, as
    /// colours that no picture changed, has equal moments, and in which tensors depends on the
    /// processor's rounding.
    fn cut(&mut self, data: &Data<'_>) -> Result<(), aho_corasick::BuildError> {
        let mut candidates = Vec::new();
        for (index, (_, bytes)) in data.theirs.iter().enumerate() {
            let pieces = bytes.chunks_exact(PIECE).filter(|it| is_distinct(it));
            let pieces: Vec<&[u8]> = pieces.collect();
            let apart = pieces.len().div_ceil(PIECES * CANDIDATES).max(1);
            let pieces = pieces.into_iter().step_by(apart);
            candidates.extend(pieces.map(|piece| (index, piece)));
        }
        let seeker = AhoCorasick::new(candidates.iter().map(|(_, piece)| piece))?;
        let hits = data.others.iter().flat_map(|other| {
            let hits = seeker.find_overlapping_iter(other);
            hits.map(|hit| hit.pattern().as_usize())
        });
        let shared: BTreeSet<usize> = hits.collect();
        for (index, (what, _)) in data.theirs.iter().enumerate() {
            let own = candidates.iter().enumerate();
            let own = own.filter(|(at, (of, _))| *of == index && !shared.contains(at));
            let own: Vec<&[u8]> = own.map(|(_, (_, piece))| *piece).collect();
            let apart = own.len().div_ceil(PIECES).max(1);
            for piece in own.into_iter().step_by(apart) {
                self.add(format!("a piece of {what}"), piece.to_vec());
            }
        }
        Ok(())
    }

    fn add(&mut self, what: String, piece: Vec<u8>) {
        self.whats.push(what);
        self.pieces.push(piece);
    }
}

/// Bytes of tensors and files: the person's with their names, and everybody else's.
#[derive(Default)]
struct Data<'a> {
    theirs: Vec<(String, Cow<'a, [u8]>)>,
    others: Vec<Cow<'a, [u8]>>,
}

impl<'a> Data<'a> {
    fn add(
        &mut self,
        theirs: bool,
        name: impl FnOnce() -> String,
        bytes: impl Into<Cow<'a, [u8]>>,
    ) {
        match theirs {
            true => self.theirs.push((name(), bytes.into())),
            false => self.others.push(bytes.into()),
        }
    }
}

/// Whether a piece has more different bytes than zeros and other constants have.
fn is_distinct(piece: &[u8]) -> bool {
    piece.iter().collect::<BTreeSet<_>>().len() >= DISTINCT
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// `length` bytes that no other `seed` gives.
    fn noise(seed: u64, length: usize) -> Vec<u8> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..length).map(|_| rng.random()).collect()
    }

    fn found(theirs: Vec<u8>, others: Vec<Vec<u8>>) -> usize {
        let mut residue = Residue {
            whats: Vec::new(),
            pieces: Vec::new(),
        };
        let mut data = Data::default();
        data.add(true, || "it".to_owned(), theirs);
        for other in others {
            data.add(false, String::new, other);
        }
        residue.cut(&data).expect("a search");
        residue.len()
    }

    #[test]
    fn pieces_that_anybody_else_has_are_no_evidence() {
        let alone = noise(1, 2048);
        assert_eq!(found(alone.clone(), vec![noise(2, 2048)]), PIECES);
        assert_eq!(found(alone.clone(), vec![alone.clone()]), 0);
        // Shifted, as other tensors before it in a file would shift it.
        let shifted = [&[9; 3], &alone[..]].concat();
        assert_eq!(found(alone.clone(), vec![shifted]), 0);
        // A tensor that is another's but for one end is told by that end.
        let mut half = alone.clone();
        half.truncate(1536);
        assert!(found(alone, vec![half]) >= PIECES / 2);
    }
}
