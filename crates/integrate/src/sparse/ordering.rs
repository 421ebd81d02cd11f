//! Order of rows and columns that keeps the non-zero entries near the diagonal.

use nalgebra_sparse::pattern::SparsityPattern;

/// An order of the degrees of freedom, for rows and columns.
#[derive(Debug)]
pub(crate) struct Ordering {
    /// `old[new]`, or none for the natural order.
    old: Option<Vec<u32>>,
}

impl Ordering {
    /// Returns the ordering with the smaller bandwidth: the natural one or reverse Cuthill–McKee.
    ///
    /// # Source
    /// Cuthill & McKee (1969); George & Liu, *Computer Solution of Large Sparse Positive Definite
    /// Systems* (1981), chapter 4.
    pub(crate) fn narrowing(pattern: &SparsityPattern) -> Self {
        let n = pattern.major_dim();
        let natural = Self { old: None };
        let width = natural.width(pattern);
        if width <= 1 {
            return natural;
        }
        let reordered = Self { old: Some(Graph::from_pattern(pattern).reverse_cuthill_mckee()) };
        debug_assert_eq!(reordered.old.as_ref().map(Vec::len), Some(n));
        if reordered.width(pattern) < width { reordered } else { natural }
    }

    pub(crate) fn is_natural(&self) -> bool {
        self.old.is_none()
    }

    /// Returns the new index of every old index.
    pub(crate) fn new_indices(&self, n: usize) -> Vec<usize> {
        let mut new_indices: Vec<usize> = (0..n).collect();
        if let Some(old) = &self.old {
            for (new, &old) in old.iter().enumerate() {
                new_indices[old as usize] = new;
            }
        }
        new_indices
    }

    /// Copies `from`, in the old order, to `to`, in the new order.
    pub(crate) fn gather(&self, from: &[f64], to: &mut [f64]) {
        match &self.old {
            None => to.copy_from_slice(from),
            Some(old) => to.iter_mut().zip(old).for_each(|(to, &old)| *to = from[old as usize]),
        }
    }

    /// Copies `from`, in the new order, to `to`, in the old order.
    pub(crate) fn scatter(&self, from: &[f64], to: &mut [f64]) {
        match &self.old {
            None => to.copy_from_slice(from),
            Some(old) => from.iter().zip(old).for_each(|(from, &old)| to[old as usize] = *from),
        }
    }

    /// Returns the maximum number of diagonals with entries.
    pub(crate) fn diagonals(&self, pattern: &SparsityPattern) -> usize {
        2 * self.width(pattern) + 1
    }

    /// Returns the largest distance of an entry from the diagonal.
    fn width(&self, pattern: &SparsityPattern) -> usize {
        let new_indices = self.new_indices(pattern.major_dim());
        let mut width = 0;
        for (i, &new) in new_indices.iter().enumerate() {
            for &j in pattern.lane(i) {
                width = width.max(new.abs_diff(new_indices[j]));
            }
        }
        width
    }
}

/// The graph of the pattern of A + Aᵀ.
pub(super) struct Graph {
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Graph {
    pub(super) fn from_pattern(pattern: &SparsityPattern) -> Self {
        let n = pattern.major_dim();
        let mut lists = vec![Vec::new(); n];
        for i in 0..n {
            for &j in pattern.lane(i).iter().filter(|j| **j != i) {
                lists[i].push(j as u32);
                lists[j].push(i as u32);
            }
        }
        let (mut starts, mut neighbours) = (vec![0], Vec::new());
        for list in &mut lists {
            list.sort_unstable();
            list.dedup();
            neighbours.extend_from_slice(list);
            starts.push(neighbours.len());
        }
        Self { starts, neighbours }
    }

    pub(super) fn neighbours(&self, node: u32) -> &[u32] {
        let node = node as usize;
        &self.neighbours[self.starts[node]..self.starts[node + 1]]
    }

    fn reverse_cuthill_mckee(&self) -> Vec<u32> {
        let n = self.starts.len() - 1;
        let mut order = Vec::with_capacity(n);
        let mut visited = vec![false; n];
        let mut by_degree: Vec<u32> = (0..n as u32).collect();
        by_degree.sort_by_key(|node| self.neighbours(*node).len());
        for start in by_degree {
            if !visited[start as usize] {
                let start = self.peripheral(start);
                self.breadth_first(start, &mut order, &mut visited);
            }
        }
        order.reverse();
        order
    }

    /// Returns a node at the edge of its component: its distance to the farthest node of the
    /// component is nearly the largest possible one.
    fn peripheral(&self, mut node: u32) -> u32 {
        let mut depth = 0;
        // Each round except the last increases the depth; a few rounds are enough.
        for _ in 0..8 {
            let (mut order, mut seen) = (Vec::new(), vec![false; self.starts.len() - 1]);
            let levels = self.breadth_first(node, &mut order, &mut seen);
            let last = &order[levels.last..];
            let far = last.iter().min_by_key(|node| self.neighbours(**node).len());
            let Some(&far) = far.filter(|_| levels.depth > depth) else { break };
            (node, depth) = (far, levels.depth);
        }
        node
    }

    /// Appends the component of `start` to `order`, neighbours of low degree first.
    fn breadth_first(&self, start: u32, order: &mut Vec<u32>, seen: &mut [bool]) -> Levels {
        let mut levels = Levels { depth: 0, last: order.len() };
        seen[start as usize] = true;
        order.push(start);
        let mut at = levels.last;
        while at < order.len() {
            let end = order.len();
            levels = Levels { depth: levels.depth + 1, last: at };
            while at < end {
                let begin = order.len();
                for &next in self.neighbours(order[at]) {
                    if !std::mem::replace(&mut seen[next as usize], true) {
                        order.push(next);
                    }
                }
                order[begin..].sort_by_key(|node| self.neighbours(*node).len());
                at += 1;
            }
        }
        levels
    }
}

/// Levels of a breadth-first search: their number, and where the last one begins.
struct Levels {
    depth: usize,
    last: usize,
}

#[cfg(test)]
mod tests {
    use mechid_model::triplets;

    use super::*;

    #[test]
    fn a_shuffled_chain_becomes_tridiagonal_again() {
        // Two chains of 40 nodes with shuffled numbers: 37 and 80 have no common factor.
        let name = |k: usize| k * 37 % 80;
        let links = (0..79).filter(|k| *k != 39).map(|k| (name(k), name(k + 1), 1.0));
        let pattern = triplets(80, links).unwrap().pattern().clone();
        let ordering = Ordering::narrowing(&pattern);
        assert_eq!(ordering.width(&pattern), 1);
        let (mut there, mut back) = (vec![0.0; 80], vec![0.0; 80]);
        let values: Vec<f64> = (0..80).map(f64::from).collect();
        ordering.gather(&values, &mut there);
        ordering.scatter(&there, &mut back);
        assert_eq!(back, values);
    }

    #[test]
    fn a_grid_numbered_the_long_way_is_turned() {
        let (long, short) = (30, 7);
        let node = |i: usize, j: usize| j * long + i;
        let mut links = vec![];
        for (i, j) in (0..long).flat_map(|i| (0..short).map(move |j| (i, j))) {
            links.push((node(i, j), node(i, j), 1.0));
            links.extend((i + 1 < long).then(|| (node(i, j), node(i + 1, j), 1.0)));
            links.extend((j + 1 < short).then(|| (node(i, j), node(i, j + 1), 1.0)));
        }
        let pattern = triplets(long * short, links).unwrap().pattern().clone();
        assert_eq!(Ordering { old: None }.width(&pattern), long);
        assert!(Ordering::narrowing(&pattern).width(&pattern) <= short + 1);
    }
}
