//! Triangular factors in panels of neighbouring columns, for many solves.

use faer::sparse::linalg::cholesky::simplicial::SymbolicSimplicialCholesky;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{SymbolicCholesky, SymbolicCholeskyRaw};

/// Widths of panels, the widest first.
const WIDTHS: [usize; 4] = [8, 4, 2, 1];

/// A lower triangular factor L, such as that of L Lᵀ, in panels of neighbouring columns with nearly
/// the same rows. One look-up of a row then serves all columns of a panel, whose entries are
/// adjacent in memory.
///
/// # Source
/// Ng and Peyton (1993), SIAM Journal on Scientific Computing 14, 1034–1056; Ashcraft and Grimes
/// (1989), ACM Transactions on Mathematical Software 15, 291–309, on the zeros that equalise the
/// rows.
#[derive(Debug)]
pub(super) struct Panels {
    panels: Vec<Panel>,
    /// Indices of the rows below the triangle of each panel, panel by panel.
    rows: Vec<u32>,
    /// Entries of each panel: the triangle, row by row, with the reciprocals of the diagonal
    /// entries; then the rows below the triangle.
    values: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
struct Panel {
    first: u32,
    width: u32,
    /// Number of rows of the panel below its triangle.
    below: u32,
}

/// Columns of a factor, each from the diagonal down.
pub(super) enum Columns<'a> {
    /// Each column separately.
    Single { symbolic: &'a SymbolicSimplicialCholesky<usize>, values: &'a [f64] },
    /// Groups of neighbouring columns with the same rows, and the index of the group of each
    /// column.
    Joint { factor: SupernodalLltRef<'a, usize, f64>, of_column: Vec<usize> },
}

impl<'a> Columns<'a> {
    pub(super) fn new(symbolic: &'a SymbolicCholesky<usize>, values: &'a [f64]) -> Self {
        match symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(symbolic) => Self::Single { symbolic, values },
            SymbolicCholeskyRaw::Supernodal(symbolic) => {
                let ends = symbolic.supernode_end().iter().zip(symbolic.supernode_begin());
                let of_column = ends
                    .enumerate()
                    .flat_map(|(s, (end, begin))| std::iter::repeat_n(s, end - begin));
                let of_column = of_column.collect();
                Self::Joint { factor: SupernodalLltRef::new(symbolic, values), of_column }
            }
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Single { symbolic, .. } => symbolic.ncols(),
            Self::Joint { of_column, .. } => of_column.len(),
        }
    }

    /// Rows and entries of a column, from the diagonal down.
    fn column(&self, j: usize) -> (Rows<'_>, &[f64]) {
        match self {
            Self::Single { symbolic, values } => {
                let range = symbolic.col_ptr()[j]..symbolic.col_ptr()[j + 1];
                (Rows { joint: 0..0, single: &symbolic.row_idx()[range.clone()] }, &values[range])
            }
            Self::Joint { factor, of_column } => {
                let node = factor.supernode(of_column[j]);
                let (start, width) = (node.start(), node.val().ncols());
                let column = node.val().col(j - start);
                let values =
                    column.try_as_col_major().expect("columns lie in one piece").as_slice();
                let rows = Rows { joint: j..start + width, single: node.pattern() };
                (rows, &values[j - start..])
            }
        }
    }
}

/// Indices of rows, in ascending order.
#[derive(Debug, Clone)]
struct Rows<'a> {
    joint: std::ops::Range<usize>,
    single: &'a [usize],
}

impl Rows<'_> {
    fn len(&self) -> usize {
        self.joint.len() + self.single.len()
    }

    fn iter(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        self.joint.clone().chain(self.single.iter().copied())
    }
}

impl Panels {
    pub(super) fn from_columns(columns: &Columns<'_>) -> Self {
        let n = columns.len();
        let mut panels = Vec::new();
        let mut first = 0;
        while first < n {
            let width = width(columns, first, n);
            let below = columns.column(first + width - 1).0.len() - 1;
            let [start, width_, below] = [first, width, below].map(|count| count as u32);
            panels.push(Panel { first: start, width: width_, below });
            first += width;
        }
        let mut rows = Vec::with_capacity(panels.iter().map(|panel| panel.below as usize).sum());
        let mut values = vec![0.0; panels.iter().map(|panel| panel.entries()).sum()];
        // Index of a row in its panel.
        let mut index = vec![0; n];
        let mut free = values.as_mut_slice();
        for panel in &panels {
            let [first, width] = [panel.first, panel.width].map(|count| count as usize);
            let panel_columns = first..first + width;
            let (last, _) = columns.column(panel_columns.end - 1);
            let below = last.iter().skip(1);
            rows.extend(below.clone().map(|row| row as u32));
            panel_columns.clone().chain(below).zip(0..).for_each(|(row, at)| index[row] = at);
            let of_panel;
            (of_panel, free) = free.split_at_mut(panel.entries());
            for (c, j) in panel_columns.enumerate() {
                let (rows, values) = columns.column(j);
                for (row, value) in rows.iter().zip(values) {
                    of_panel[index[row] * width + c] = *value;
                }
                of_panel[c * width + c] = values[0].recip();
            }
        }
        Self { panels, rows, values }
    }

    /// Solves L Lᵀ x = `b`, in place.
    pub(super) fn solve(&self, b: &mut [f64]) {
        self.down(b);
        self.up(b);
    }

    /// Solves L x = `b`, in place.
    pub(super) fn down(&self, b: &mut [f64]) {
        let (mut rows, mut values) = (self.rows.as_slice(), self.values.as_slice());
        for panel in &self.panels {
            let (below, of_panel);
            (below, rows) = rows.split_at(panel.below as usize);
            (of_panel, values) = values.split_at(panel.entries());
            let down = match panel.width {
                8 => down::<8>,
                4 => down::<4>,
                2 => down::<2>,
                _ => down::<1>,
            };
            down(panel.first as usize, below, of_panel, b);
        }
    }

    /// Solves Lᵀ x = `b`, in place.
    pub(super) fn up(&self, b: &mut [f64]) {
        let (mut rows, mut values) = (self.rows.as_slice(), self.values.as_slice());
        for panel in self.panels.iter().rev() {
            let (below, of_panel);
            (rows, below) = rows.split_at(rows.len() - panel.below as usize);
            (values, of_panel) = values.split_at(values.len() - panel.entries());
            let up = match panel.width {
                8 => up::<8>,
                4 => up::<4>,
                2 => up::<2>,
                _ => up::<1>,
            };
            up(panel.first as usize, below, of_panel, b);
        }
    }
}

impl Panel {
    /// Returns the number of stored entries: a full square that contains the triangle, and the rows
    /// below it.
    fn entries(self) -> usize {
        self.width as usize * (self.width + self.below) as usize
    }
}

/// Returns the width of the panel from column `first` on that has the lowest cost per column.
fn width(columns: &Columns<'_>, first: usize, n: usize) -> usize {
    // Let j be the first row below the diagonal of a column. All rows of this column below the
    // diagonal are also rows of column j. If j is the next column for every column of a panel, the
    // last column of the panel has all rows that the panel has below its triangle.
    let follows = |j: &usize| columns.column(*j).0.iter().nth(1) == Some(j + 1);
    let chain = 1 + (first..n - 1).take(WIDTHS[0] - 1).take_while(follows).count();
    // The unit of cost is one entry; each row and each panel cost as much as several entries.
    let cost = |width: usize| {
        let rows = columns.column(first + width - 1).0.len() + width;
        (rows * (width + PER_ROW) + PER_PANEL) as f64 / width as f64
    };
    let possible = WIDTHS.into_iter().filter(|width| *width <= chain);
    possible.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(1)
}

/// Time for each row of a panel, in units of the time for one entry.
const PER_ROW: usize = 3;

/// Time for each panel, in units of the time for one entry.
const PER_PANEL: usize = 12;

/// Solves one panel of L x = b.
fn down<const W: usize>(first: usize, rows: &[u32], values: &[f64], b: &mut [f64]) {
    let (triangle, below) = values.as_chunks::<W>().0.split_at(W);
    let mut x = [0.0; W];
    x.copy_from_slice(&b[first..first + W]);
    for (r, row) in triangle.iter().enumerate() {
        for c in 0..r {
            x[r] -= row[c] * x[c];
        }
        x[r] *= row[r];
    }
    b[first..first + W].copy_from_slice(&x);
    for (row, entries) in rows.iter().zip(below) {
        let mut products = [0.0; W];
        for c in 0..W {
            products[c] = entries[c] * x[c];
        }
        b[*row as usize] -= sum(products);
    }
}

/// Solves one panel of Lᵀ x = b.
fn up<const W: usize>(first: usize, rows: &[u32], values: &[f64], b: &mut [f64]) {
    let (triangle, below) = values.as_chunks::<W>().0.split_at(W);
    let mut x = [0.0; W];
    x.copy_from_slice(&b[first..first + W]);
    for (row, entries) in rows.iter().zip(below) {
        let known = b[*row as usize];
        for c in 0..W {
            x[c] -= entries[c] * known;
        }
    }
    for (r, row) in triangle.iter().enumerate().rev() {
        x[r] *= row[r];
        for c in 0..r {
            x[c] -= row[c] * x[r];
        }
    }
    b[first..first + W].copy_from_slice(&x);
}

/// Returns the sum of a few numbers by halves, which shortens the chain of dependent additions.
fn sum<const W: usize>(mut values: [f64; W]) -> f64 {
    let mut half = W / 2;
    while half > 0 {
        for c in 0..half {
            values[c] += values[c + half];
        }
        half /= 2;
    }
    values[0]
}
