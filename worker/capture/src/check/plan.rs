//! The choice of frames to look at: all of a short film, and of a long one runs of consecutive frames spread
//! over it, since only neighbours show that masks are a frame late.

/// Most frames to look at.
const MOST: usize = 400;
/// Consecutive frames in a run.
const RUN: usize = 40;

/// Positions in the track, ascending.
pub(super) fn positions(frames: usize) -> Vec<usize> {
    if frames <= MOST {
        return (0..frames).collect();
    }
    let runs = MOST / RUN;
    (0..runs)
        .flat_map(|run| {
            let start = run * (frames - RUN) / (runs - 1);
            start..start + RUN
        })
        .collect()
}

/// At most `count` of `items`, evenly spread.
pub(super) fn spread<T: Copy>(items: &[T], count: usize) -> Vec<T> {
    let count = count.min(items.len());
    (0..count)
        .filter_map(|i| items.get((2 * i + 1) * items.len() / (2 * count)).copied())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_films_are_looked_at_in_runs_and_short_ones_whole() {
        assert_eq!(positions(3), [0, 1, 2]);
        for frames in [401, 5_000, 100_000] {
            let chosen = positions(frames);
            assert!(chosen.is_sorted_by(|a, b| a < b), "{frames}");
            assert_eq!(chosen.len(), MOST);
            assert_eq!((chosen[0], chosen[MOST - 1]), (0, frames - 1));
        }
        assert_eq!(spread(&[1, 2, 3], 5), [1, 2, 3]);
        assert_eq!(spread(&(0..100).collect::<Vec<_>>(), 4), [12, 37, 62, 87]);
        assert!(spread::<u8>(&[], 4).is_empty());
    }
}
