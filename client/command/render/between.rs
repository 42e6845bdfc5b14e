//! The form of `--between`: two people, and shares of the second.

use std::str::FromStr;

/// Most mixtures in one render, as the service allows.
const MOST: u32 = 100;

/// Two people, and the shares of the second in mixtures of both.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BetweenTwo {
    /// The first one's name.
    pub one: String,
    /// The second one's name.
    pub other: String,
    first: f32,
    last: f32,
    count: u32,
}

impl BetweenTwo {
    /// Evenly spaced from the first to the last.
    pub(crate) fn shares(&self) -> Vec<f32> {
        let step = (self.last - self.first) / (self.count.max(2) - 1) as f32;
        let share = |i: u32| self.first + step * i as f32;
        (0..self.count).map(|i| share(i).clamp(0.0, 1.0)).collect()
    }
}

impl FromStr for BetweenTwo {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let shape = || format!("'{text}' is not of the form A,B:0.5 or A,B:0..1:10");
        let (names, shares) = text.split_once(':').ok_or_else(shape)?;
        let (one, other) = names.split_once(',').ok_or_else(shape)?;
        let share = |text: &str| match text.parse::<f32>() {
            Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
            _ => Err(format!("'{text}' is not a share from 0 to 1")),
        };
        let (first, last, count) = match shares.split_once(':') {
            None => (share(shares)?, share(shares)?, 1),
            Some((range, count)) => {
                let (first, last) = range.split_once("..").ok_or_else(shape)?;
                let count: u32 = count.parse().map_err(|_| shape())?;
                if !(2..=MOST).contains(&count) {
                    return Err(format!("{count} mixtures: 2 to {MOST} are allowed"));
                }
                (share(first)?, share(last)?, count)
            }
        };
        if one.is_empty() || other.is_empty() || one == other {
            return Err(shape());
        }
        Ok(Self {
            one: one.to_owned(),
            other: other.to_owned(),
            first,
            last,
            count,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_share_or_a_row_of_them() {
        let shares = |text: &str| text.parse::<BetweenTwo>().map(|it| it.shares());
        assert_eq!(shares("a,b:0.25"), Ok(vec![0.25]));
        assert_eq!(shares("a,b:0..1:3"), Ok(vec![0.0, 0.5, 1.0]));
        assert_eq!(shares("a,b:1..0.5:2"), Ok(vec![1.0, 0.5]));
        for bad in [
            "a,b",
            "a:0.5",
            "a,b:1.5",
            "a,a:0",
            ",b:0",
            "a,b:0..1:1",
            "a,b:0..1",
        ] {
            assert!(shares(bad).is_err(), "{bad}");
        }
    }
}
