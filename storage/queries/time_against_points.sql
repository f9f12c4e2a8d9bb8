-- seconds against points in, per stage that reads points: the slope says what a million more cost
with timed as (
  select stage, wall_s, case when points_in > 0 then points_in else points_out end as points
  from stages
  where outcome = 'computed'
)
select stage,
       count(*) as runs,
       min(points) as fewest_points,
       max(points) as most_points,
       round(sum(wall_s) / sum(points) * 1e6, 3) as s_per_million_points,
       -- a line needs runs of two sizes at least
       case when max(points) > min(points)
         then round(regr_slope(wall_s, points) * 1e6, 3) end as slope_s_per_million_points,
       case when max(points) > min(points)
         then round(regr_intercept(wall_s, points), 3) end as intercept_s,
       case when max(points) > min(points) then round(regr_r2(wall_s, points), 3) end as r2
from timed
where points > 0
group by stage
order by s_per_million_points desc, stage
