//! Block diagrams: boxes on a grid, joined by arrows that run along it.

use mechid::plot::{Canvas, Color, Point, Stroke, TextStyle, Weight, text_width};

use super::symbols::{arrow_head, rounded};

const BOX_HEIGHT: f64 = 76.0;
const GAP: Point = (46.0, 40.0);
const EDGE: f64 = 18.0;
const TITLE: f64 = 34.0;
const HEADING_SIZE: f64 = 12.5;
const LINE_SIZE: f64 = 11.5;
const LINE_STEP: f64 = 15.5;
const PADDING: f64 = 10.0;
const ARROW: Stroke = Stroke::solid(Color::DARK, 1.2);

/// Meaning of a box, shown by its colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Given or measured quantity.
    Data,
    /// Computation from the inputs of the box.
    Process,
    /// Result of the diagram.
    Result,
    /// Comparison of a result with the truth.
    Comparison,
}

impl Role {
    fn colors(self) -> (Color, Color) {
        match self {
            Role::Data => (Color("#f6f6f6"), Color::GREY),
            Role::Process => (Color("#e6f1f8"), Color::BLUE),
            Role::Result => (Color("#e4f4ee"), Color::GREEN),
            Role::Comparison => (Color("#fdf3e0"), Color::BROWN),
        }
    }
}

/// Path of an arrow from box to box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    /// Along the row or the column that contains both boxes.
    Straight,
    /// Along the row of the first box, then along the column of the second box.
    RowFirst,
    /// Along the column of the first box, then along the row of the second box.
    ColumnFirst,
    /// Below all boxes.
    Below,
}

/// Handle of a box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoxId(usize);

#[derive(Debug)]
struct Block {
    column: usize,
    row: usize,
    role: Role,
    heading: String,
    lines: Vec<String>,
}

#[derive(Debug)]
struct Arrow {
    from: BoxId,
    to: BoxId,
    route: Route,
    both_ends: bool,
}

/// A block diagram to which boxes and arrows are added one by one.
#[derive(Debug)]
pub struct BlockDiagram {
    title: String,
    blocks: Vec<Block>,
    arrows: Vec<Arrow>,
}

impl BlockDiagram {
    /// An empty diagram.
    pub fn new(title: impl Into<String>) -> Self {
        BlockDiagram { title: title.into(), blocks: Vec::new(), arrows: Vec::new() }
    }

    /// Puts a box into a cell of the grid, with a heading and up to three lines.
    pub fn block(
        &mut self,
        cell: (usize, usize),
        role: Role,
        heading: &str,
        lines: &[&str],
    ) -> BoxId {
        self.blocks.push(Block {
            column: cell.0,
            row: cell.1,
            role,
            heading: heading.to_owned(),
            lines: lines.iter().map(|line| (*line).to_owned()).collect(),
        });
        BoxId(self.blocks.len() - 1)
    }

    /// Joins two boxes.
    pub fn arrow(&mut self, from: BoxId, to: BoxId, route: Route) {
        self.arrows.push(Arrow { from, to, route, both_ends: false });
    }

    /// Joins two compared boxes by an arrow with two heads.
    pub fn double_arrow(&mut self, from: BoxId, to: BoxId) {
        self.arrows.push(Arrow { from, to, route: Route::Straight, both_ends: true });
    }

    /// The diagram as an SVG document.
    pub fn to_svg(&self) -> String {
        let grid =
            Grid::new(&self.blocks, self.arrows.iter().any(|arrow| arrow.route == Route::Below));
        let mut sheet = Canvas::new(grid.size.0, grid.size.1);
        sheet.text((grid.size.0 / 2.0, 25.0), &self.title, &TextStyle::new(15.0).bold());
        for arrow in &self.arrows {
            self.draw_arrow(&grid, arrow, &mut sheet);
        }
        for block in &self.blocks {
            draw_block(&grid, block, &mut sheet);
        }
        sheet.finish(&self.title)
    }

    fn draw_arrow(&self, grid: &Grid, arrow: &Arrow, sheet: &mut Canvas) {
        let (from, to) = (&self.blocks[arrow.from.0], &self.blocks[arrow.to.0]);
        let (start, end) = (grid.center(from), grid.center(to));
        let mut path = match arrow.route {
            Route::Straight => vec![start, end],
            Route::RowFirst => vec![start, (end.0, start.1), end],
            Route::ColumnFirst => vec![start, (start.0, end.1), end],
            Route::Below => vec![start, (start.0, grid.below), (end.0, grid.below), end],
        };
        let last = path.len() - 1;
        path[0] = grid.leave(from, path[1]);
        path[last] = grid.leave(to, path[last - 1]);
        sheet.polyline(&path, ARROW);
        arrow_head(sheet, path[last - 1], path[last], 8.0, Color::DARK);
        if arrow.both_ends {
            arrow_head(sheet, path[1], path[0], 8.0, Color::DARK);
        }
    }
}

/// Positions of the columns and rows.
struct Grid {
    /// Centre and width of each column.
    columns: Vec<(f64, f64)>,
    below: f64,
    size: Point,
}

impl Grid {
    fn new(blocks: &[Block], uses_below: bool) -> Self {
        let count = blocks.iter().map(|block| block.column + 1).max().unwrap_or(0);
        let rows = blocks.iter().map(|block| block.row + 1).max().unwrap_or(0);
        let mut x = EDGE;
        let mut columns = Vec::with_capacity(count);
        for column in 0..count {
            let width = blocks
                .iter()
                .filter(|block| block.column == column)
                .map(width)
                .fold(60.0, f64::max);
            columns.push((x + width / 2.0, width));
            x += width + GAP.0;
        }
        let bottom = TITLE + EDGE + rows as f64 * (BOX_HEIGHT + GAP.1) - GAP.1;
        let below = bottom + GAP.1 / 2.0;
        let height = if uses_below { below + EDGE } else { bottom + EDGE };
        Grid { columns, below, size: (x - GAP.0 + EDGE, height) }
    }

    fn center(&self, block: &Block) -> Point {
        let y = TITLE + EDGE + block.row as f64 * (BOX_HEIGHT + GAP.1) + BOX_HEIGHT / 2.0;
        (self.columns[block.column].0, y)
    }

    /// Returns the point where a line from the middle of a box towards `next` crosses the box's
    /// edge.
    fn leave(&self, block: &Block, next: Point) -> Point {
        let (x, y) = self.center(block);
        let (dx, dy) = (next.0 - x, next.1 - y);
        if dx.abs() > dy.abs() {
            (x + dx.signum() * self.columns[block.column].1 / 2.0, y)
        } else {
            (x, y + dy.signum() * BOX_HEIGHT / 2.0)
        }
    }
}

fn width(block: &Block) -> f64 {
    let heading = text_width(&block.heading, HEADING_SIZE, Weight::Bold);
    let lines = block.lines.iter().map(|line| text_width(line, LINE_SIZE, Weight::Regular));
    lines.fold(heading, f64::max) + 2.0 * PADDING
}

fn draw_block(grid: &Grid, block: &Block, sheet: &mut Canvas) {
    let (x, y) = grid.center(block);
    let width = grid.columns[block.column].1;
    let (fill, edge) = block.role.colors();
    let corner = (x - width / 2.0, y - BOX_HEIGHT / 2.0);
    rounded(sheet, corner, (width, BOX_HEIGHT), 6.0, fill, Stroke::solid(edge, 1.3));
    let text_height = LINE_STEP * block.lines.len() as f64;
    let mut baseline = y - text_height / 2.0 + 0.36 * HEADING_SIZE;
    sheet.text((x, baseline), &block.heading, &TextStyle::new(HEADING_SIZE).bold());
    for line in &block.lines {
        baseline += LINE_STEP;
        sheet.text((x, baseline), line, &TextStyle::new(LINE_SIZE));
    }
}
