"""What the report asks a store: the SQL it quotes is the SQL that was run."""

PLANS = """
-- the last evaluation of each storey, variant and seed: which plan it compared, with which truth
select building, storey, variant, seed, id as run, started_at, parameters, asked
from runs
where verb = 'evaluate' and state in ('completed', 'partial'){only}
qualify row_number() over (
  partition by building, storey, variant, seed order by started_at desc, id desc
) = 1
order by building, storey, variant, seed nulls first
"""

AREAS = """
-- area error of each true room (Sec. 7.3), null where nothing was found of it
select building, storey, scan, variant, seed, simulated, true_id as room,
       abs(true_m2 - found_m2) as error_m2
from detections
-- every room with the one it shares most area with: the worst must not be left out
where class = 'room' and metric = 'iou' and threshold = 0 and true_id is not null{only}
order by building, storey, scan nulls first, variant, seed nulls first, room
"""

SCORES = """
-- recall and precision of each plan, by what the paper looks for
with asked(place, what, criterion, class, metric, threshold) as (values
  (1, 'rooms', 'IoU > 0.5', 'room', 'iou', 0.5),
  (2, 'walls', 'both ends within 20 cm', 'wall', 'distance_m', 0.2),
  (4, 'doors', 'IoU > 0.5', 'door', 'iou', 0.5),
  (5, 'windows', 'IoU > 0.5', 'window', 'iou', 0.5),
  (6, 'furniture', 'footprint IoU > 0.25', 'furniture', 'iou', 0.25)
),
found as (
  select place, what, criterion, building, storey, scan, variant, seed,
         bool_or(simulated) as simulated,
         count(true_id)::double as n_true,
         count(found_id)::double as n_found,
         count(*) filter (true_id is not null and found_id is not null) as n_matched
  from detections join asked using (class, metric, threshold)
  where true{only}
  group by all
)
select place, what, criterion, building, storey, scan, variant, seed, simulated, n_true, n_found,
       n_matched / nullif(n_true, 0) as recall,
       n_matched / nullif(n_found, 0) as precision
from found
union all
select 3, 'wall faces', 'length within 10 cm', building, storey, scan, variant, seed, simulated,
       true_m, found_m, completeness, correctness
from wall_quality
where buffer_m = 0.1{only}
order by place, variant, building, storey, scan nulls first, seed nulls first
"""

CURVES = """
-- precision and recall at each threshold: the plans of one seed counted together
with counted as (
  select class, metric, threshold, variant, seed, bool_or(simulated) as simulated,
         count(true_id) as n_true,
         count(found_id) as n_found,
         count(*) filter (true_id is not null and found_id is not null) as n_matched
  from detections
  -- at 0 rooms are compared by area, not found
  where threshold > 0{only}
  group by class, metric, threshold, variant, seed, simulated
)
select class, metric, threshold, variant, seed, simulated, n_true, n_found, n_matched,
       n_matched / nullif(n_true, 0) as recall,
       n_matched / nullif(n_found, 0) as precision
from counted
order by class, metric, variant, threshold, seed nulls first
"""

TIMES = """
-- seconds of each computed stage against points: those it reads, or makes, or its scan has
with of_scan as (
  select run, building, storey, scan, max(greatest(points_in, points_out)) as points
  from stages
  where scan is not null
  group by run, building, storey, scan
),
of_storey as (
  select run, building, storey, sum(points) as points from of_scan group by run, building, storey
),
timed as (
  select s.building, s.stage, s.id, s.wall_s,
         coalesce(nullif(s.points_in, 0), nullif(s.points_out, 0),
                  case when s.scan is null then o.points else c.points end) as points
  from stages s
  left join of_scan c
    on c.run = s.run and c.building = s.building and c.storey = s.storey and c.scan = s.scan
  left join of_storey o on o.run = s.run and o.building = s.building and o.storey = s.storey
  where s.outcome = 'computed' and s.wall_s > 0
),
-- the line on log-log paper is fitted to all runs, of which some are drawn
fitted as (
  select *,
         count(*) over each_stage as runs,
         sum(wall_s) over each_stage as total_s,
         min(points) over each_stage < max(points) over each_stage as has_slope,
         regr_slope(ln(wall_s), ln(points)) over each_stage as exponent,
         regr_intercept(ln(wall_s), ln(points)) over each_stage as log_factor
  from timed
  where points > 0{only}
  window each_stage as (partition by stage)
)
select stage, points, wall_s, runs, round(total_s, 6) as total_s,
       case when has_slope then round(exponent, 6) end as exponent,
       case when has_slope then round(log_factor, 6) end as log_factor
from fitted
qualify row_number() over (partition by stage order by md5(id)) <= 250
order by stage, points, wall_s
"""

ENERGY = """
-- simulated joules of each method, number of queries and seed
select distinct building, storey, series, n_queries, method, seed, total_j
from energy
where true{only}
order by building, storey, series, n_queries, method, seed
"""


RUNS = """
-- every run there was
select id, verb, building, storey, variant, seed, state, ended_at
from runs
where true{only}
order by started_at, id
"""


def written(sql: str, buildings: tuple[str, ...]) -> str:
    """Return a query as it is run: of some buildings, or of all if none is named."""
    names = ", ".join(f"'{name}'" for name in buildings)  # a name has no quotes: check_name
    only = f"\n  and building in ({names})" if buildings else ""
    return sql.strip().replace("{only}", only)
