//! The number of splats of a person while their poses are refined: few while poses are wrong, since many small ones learn
//! the mean of wrong poses by heart (docs/research/splats.md).

use super::PoseRefinement;
use crate::config::{Extent, SplatConfig};

/// Fits per frame of the track before splats become many. With fewer, poses are hardly better than given, and a
/// held-out frame of a synthetic film lost 1.6 dB (`worker/avatar/tests/it/curve.rs`).
const FITS: f64 = 2.5;
/// Share of a run after which splats become no more: they would not learn.
const LAST_GROWTH: f64 = 0.6;

impl PoseRefinement {
    /// Whether splats were placed while these poses were refined.
    pub(crate) fn has_placed(&self) -> bool {
        self.placed > 0
    }

    /// Number of the splats that a training starts with that refines these poses. The call counts as
    /// their placement.
    pub(crate) fn initial_splat_count(
        &mut self,
        config: &SplatConfig,
        schedule_progress: f64,
        fraction: f64,
    ) -> usize {
        self.placed = 1;
        self.placed_at = self.progress(schedule_progress, fraction) as f32;
        match self.extent {
            Extent::Wide => config.initial_count(),
            Extent::Fine => config.count,
        }
    }

    /// The number that splats are due to become: when frames were fitted a few times, and enough of the run is left
    /// for them to learn, first the geometric mean of few and all, and later all. The call counts as their
    /// growth.
    pub(crate) fn due_splat_count(
        &mut self,
        config: &SplatConfig,
        schedule_progress: f64,
        fraction: f64,
    ) -> Option<usize> {
        let progress = self.progress(schedule_progress, fraction);
        // Somebody who came in the middle of a run has what was left of it.
        let from = f64::from(self.placed_at);
        let passed = (progress - from) / (1.0 - from).max(f64::MIN_POSITIVE);
        let fitted = f64::from(self.fits) >= FITS * self.changes.len() as f64;
        if self.extent == Extent::Fine || fraction > LAST_GROWTH || !fitted {
            return None;
        }
        match self.placed {
            1 if passed >= config.grow => {
                self.placed = 2;
                let product = (config.initial_count() * config.count) as f64;
                Some(product.sqrt() as usize)
            }
            2 if passed >= config.grow_all => {
                self.placed = 3;
                Some(config.count)
            }
            _ => None,
        }
    }
}
